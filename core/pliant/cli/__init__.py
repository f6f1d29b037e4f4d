"""The `pliant` command: `app` is the entry point, `verbs` gathers the verbs, `session` contains what they share."""
