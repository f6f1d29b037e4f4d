"""The `pliant` command: `app` gathers the verbs, one file each; `session` holds what they share."""
