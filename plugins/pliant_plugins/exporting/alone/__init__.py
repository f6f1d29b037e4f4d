"""Modules that are written into the folder of exported files. They run without Pliant; Pliant never imports them."""
