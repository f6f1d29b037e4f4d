"""The `pliant` command: `app` is the entry point, `verbs` gathers the verbs, `session` holds what they share."""
