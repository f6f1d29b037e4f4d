"""The evidence page: compare, see where, learn which, add it, watch the error fall, in the browser on this machine.

A session lives in a folder (`folder`): what was brought, the steps, and every result under a key of what it depends
on. `desk` answers what the page asks by the engine of the commands; `server` puts it on loopback behind a token.
"""
