"""Distribution of work over this process, worker processes or a cluster, and recovery from dead workers."""
