"""Design for a task: what is varied, what it comes to, who proposes, and the check of the best by direct FEM."""
