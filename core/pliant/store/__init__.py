"""Content-addressed artifacts: records as files (`codec`), code as a hash (`fingerprint`), the folder (`store`)."""
