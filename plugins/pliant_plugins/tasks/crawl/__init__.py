"""Crawl: chains on a floor under periodic actuation."""
