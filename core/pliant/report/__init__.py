"""A finished run as a folder (`folder`) and as one self-contained HTML page (`page`, `figures`)."""
