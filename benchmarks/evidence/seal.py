"""Labels that the diagnosing process cannot read.

A label is added to a key stream (SHAKE-256 of the key and a fresh nonce, used once) and authenticated by
HMAC-SHA256, so that a changed file is detected. The bench's key is in the judge's file, readable by its owner only; an
example's key comes from a passphrase. Nothing under `core/` or `plugins/` reads sealed files, which a test checks.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import json
import os
import secrets
from pathlib import Path
from typing import Any

KEY_BYTES = NONCE_BYTES = 32
SUFFIX = ".sealed"


class BrokenSealError(Exception):
    """The label was changed, or this is not its key."""


def seal(label: dict[str, Any], key: bytes) -> str:
    """Return the label as one line of hexadecimal text: nonce, digest, secret."""
    nonce = secrets.token_bytes(NONCE_BYTES)
    secret = _added(json.dumps(label).encode(), key, nonce)
    return "\n".join(part.hex() for part in (nonce, _digest(key, nonce, secret), secret)) + "\n"


def unseal(text: str, key: bytes) -> dict[str, Any]:
    """Return the label. Raises `BrokenSealError` if text or key are not those of `seal`."""
    try:
        nonce, digest, secret = (bytes.fromhex(part) for part in text.split())
    except ValueError as error:
        raise BrokenSealError("this is no sealed label: nonce, digest and secret in hexadecimal") from error
    if not hmac.compare_digest(digest, _digest(key, nonce, secret)):
        raise BrokenSealError("the label was changed after it was sealed, or the key is not its own")
    return json.loads(_added(secret, key, nonce))


def judge_key(path: Path) -> bytes:
    """Return the key in the judge's file; created on first use, readable by its owner only."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with contextlib.suppress(FileExistsError):
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w") as file:
            file.write(secrets.token_hex(KEY_BYTES))
    return bytes.fromhex(path.read_text())


def passphrase_key(passphrase: str, salt: bytes = b"pliant hidden effect") -> bytes:
    """Derive a key from a passphrase, slowly enough to prevent a dictionary attack (scrypt, RFC 7914)."""
    normal = " ".join(passphrase.lower().split())
    return hashlib.scrypt(normal.encode(), salt=salt, n=2**14, r=8, p=1, dklen=KEY_BYTES)


def _added(data: bytes, key: bytes, nonce: bytes) -> bytes:
    stream = hashlib.shake_256(b"stream" + key + nonce).digest(len(data))
    return bytes(a ^ b for a, b in zip(data, stream, strict=True))


def _digest(key: bytes, nonce: bytes, secret: bytes) -> bytes:
    return hmac.new(b"digest" + key, nonce + secret, hashlib.sha256).digest()
