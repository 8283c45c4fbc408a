"""Where a dataset is, as people write it: a path, or an address."""

import re
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit, urlunsplit

from dataset_builder.errors import Problem, UserError

DRIVERS = {"http": ("fsspec", "aiohttp"), "https": ("fsspec", "aiohttp"), "s3": ("fsspec", "s3fs"),
           "gs": ("fsspec", "gcsfs"), "hf": ("fsspec", "huggingface_hub")}
"""Libraries that read what lies at addresses with each scheme."""
HUB = re.compile(r"datasets/[\w.-]+/[\w.-]+(@[\w./-]+)?")
SAID = 200
"""Characters of a library's message."""
SAFE = "/%:@!$&'()*+,;=~"
"""What may stay as it is in the path of an address."""
PASSWORDS = "in a password / ? # @ are written %2F %3F %23 %40"


def is_address(text: Path | str) -> bool:
    """Whether something is an address, and no path."""
    return isinstance(text, str) and "://" in text


def shown(address: str) -> str:
    """An address without passwords, keys and queries, for messages.

    >>> shown("https://me:secret@example.org/a b?key=1#part")
    'https://example.org/a b'
    """
    try:
        scheme, netloc, path, _, _ = urlsplit(address)
    except ValueError:
        return bare(address)
    return f"{scheme}://{netloc.rpartition('@')[2]}{path}".rstrip("/")


def bare(text: str) -> str:
    """What may be shown of what somebody took for an address: a password in it that was not encoded may look like
    part of path, query or port.

    >>> bare("https://me:sec/ret@example.org/a")
    'https://example.org/a'
    """
    scheme, _, rest = text.partition("://")
    public = scheme.lower() == "file" or (scheme.lower() == "hf" and rest.startswith("datasets/"))
    return f"{scheme}://{re.split('[?#]', rest if public else rest.rpartition('@')[2])[0]}".rstrip("/")


def title_of(folder: Path | str) -> str:
    """What messages call a folder or an address."""
    return shown(folder) if isinstance(folder, str) and is_address(folder) else str(folder)


def scrubbed(text: str) -> str:
    """What a library says, without what is secret in the addresses in it."""
    return re.sub(r"\w+://[^\s'\")]+", lambda match: shown(match[0]), text)


def said(error: BaseException) -> str:
    """The kind of an error of some library and the beginning of its words, without what is secret in them.

    >>> said(ValueError("no bucket at s3://me:secret@x"))
    'ValueError: no bucket at s3://x'
    """
    return f"{type(error).__name__}: {scrubbed(str(error))[:SAID]}"


def file_url(address: str, name: str) -> str:
    """The address of a file at an http address; a query stays, which may be a key.

    >>> file_url("https://example.org/a b/?key=1", "shards/x.tar")
    'https://example.org/a%20b/shards/x.tar?key=1'
    """
    scheme, netloc, path, query, _ = urlsplit(address)
    return urlunsplit((scheme, netloc, f"{quote(path.rstrip('/'), safe=SAFE)}/{quote(name)}", query, ""))


def local_path(address: str) -> Path:
    """The path that an address with `file` stands for. Raises UserError where it has a host."""
    parts = urlsplit(address)
    if parts.netloc not in ("", "localhost") or not parts.path:
        raise refused(address, "expected file:///PATH, without a host", "write the path alone")
    if parts.query or parts.fragment:
        raise refused(address, "expected file:///PATH, got ? or # after it", "write the path alone, or %3F and %23")
    return Path(unquote(parts.path))


def require_sound(address: str, scheme: str) -> None:
    """Raise UserError where an address has no host, or is not in the form that its scheme has."""
    try:
        parts = urlsplit(address)
        sound = bool(parts.netloc and (parts.hostname or scheme == "hf")) and (parts.port or 1) > 0
    except ValueError:
        sound = False
    if not sound or re.search(r"[\x00-\x1f\x7f]", address):
        raise refused(address, f"expected {scheme}://HOST/PATH", PASSWORDS * ("@" in address))
    if scheme in ("http", "https") and parts.fragment:
        raise refused(address, "expected nothing after a #", f"a name with # has %23 in its place; {PASSWORDS}")
    if scheme in ("s3", "gs") and "@" in parts.netloc:
        raise refused(address, f"expected {scheme}://BUCKET/PATH, got more before the bucket",
                      "keys are set in the environment")
    if scheme == "hf" and not HUB.fullmatch(address.partition("://")[2].rstrip("/")):
        raise refused(address, "expected hf://datasets/USER/NAME or hf://datasets/USER/NAME@REVISION, nothing "
                      "before or after it", "keys are set in the environment")


def refused(address: str, rule: str, hint: str = "") -> UserError:
    """What is said of an address that cannot be used."""
    return UserError([Problem(where=bare(address), path="", rule=rule, hint=hint)])
