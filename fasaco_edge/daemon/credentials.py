"""Files that a service manager lends the service, see LoadCredential= in systemd.exec(5).

Their folder has another name for each service, so that a configuration that several read can
only say where to find it: ``$CREDENTIALS_DIRECTORY/key.pem``.
"""

from __future__ import annotations

import os
from collections.abc import Mapping

FOLDER = "CREDENTIALS_DIRECTORY"


def with_credentials(part: object, environ: Mapping[str, str] = os.environ) -> object:
    """Return a part of a configuration with the folder in place of its name.

    Where nobody lends anything the name stays: the file is missing then, and is named so.
    """
    folder = environ.get(FOLDER)
    if folder is None:
        return part
    if isinstance(part, dict):
        return {key: with_credentials(value, environ) for key, value in part.items()}
    if isinstance(part, str) and part.startswith(f"${FOLDER}/"):
        return folder + part.removeprefix(f"${FOLDER}")
    return part
