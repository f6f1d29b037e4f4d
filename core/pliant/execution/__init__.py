"""How work is spread over this process, worker processes or a cluster, and what happens when a worker dies."""
