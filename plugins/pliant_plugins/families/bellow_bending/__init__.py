"""Bellow with a strain-limiting plate along one side: pressure bends it about the plate."""
