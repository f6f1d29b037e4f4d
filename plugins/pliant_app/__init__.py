"""The evidence page: compare, localise errors, diagnose, add effects and compare again, in a browser on this machine.

A session is stored in a folder (`folder`): its files, its steps, and every result under a key of its inputs.
`controller` answers the page's requests with the functions of the commands; `server` serves it on loopback behind a
token.
"""
