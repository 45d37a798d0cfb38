"""Writing files so that they are whole or absent."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def write_atomic(path: Path, content: str | bytes) -> None:
    """Writes a file under a temporary name beside `path`, then renames it.

    Args:
        path: the file; its folder is made if need be. An existing file is replaced.
        content: text (written as UTF-8) or bytes.

    Raises:
        OSError: if the folder cannot be written; `path` is then as it was.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)
        temporary.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Writes JSON (two-space indent, no NaN) by :func:`write_atomic`.

    Raises:
        ValueError: if the content holds NaN or infinity; nothing is written then.
    """
    write_atomic(path, json.dumps(content, indent=2, allow_nan=False) + "\n")
