"""Bellow with a constraint inside along one side: pressure bends it, and it twists and bends sideways."""
