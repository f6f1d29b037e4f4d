"""Search of designs for a task: variables, evaluation, optimizers, and the check of the best design by direct FEM."""
