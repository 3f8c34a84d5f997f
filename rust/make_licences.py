"""Write THIRD_PARTY_LICENSES: crates that are compiled into the extension module, with their licences.

python rust/make_licences.py

Names and versions are those of Cargo.lock; texts come from the sources that cargo has unpacked. Nothing is downloaded.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "THIRD_PARTY_LICENSES"
EXTENSION = "imufit-py"
PLATFORM = "x86_64-unknown-linux-gnu"
"""Platform whose crates are listed: that of the wheel which CI builds."""
NAMES = ("LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE")
HEAD = """Licences of the Rust crates that are compiled into imufit's extension module.

Written by `python rust/make_licences.py` from Cargo.lock: do not edit. Where a crate leaves the choice, imufit takes
the MIT licence. imufit itself is under the licence in the file LICENSE.
"""


def metadata() -> dict[str, Any]:
    """Return what cargo knows of the workspace, from what is on this machine."""
    command = ["cargo", "metadata", "--format-version", "1", "--offline", "--locked", "--filter-platform", PLATFORM]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def linked(found: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the crates of others that the extension module is linked with, by name and version.

    Macros run in the compiler alone, so neither they nor what they use are in the module.
    """
    packages = {package["id"]: package for package in found["packages"]}
    needs = {node["id"]: node["deps"] for node in found["resolve"]["nodes"]}
    waiting = [package["id"] for package in found["packages"] if package["name"] == EXTENSION]
    seen: set[str] = set()
    while waiting:
        here = waiting.pop()
        if here in seen or any("proc-macro" in target["kind"] for target in packages[here]["targets"]):
            continue
        seen.add(here)
        waiting += [need["pkg"] for need in needs[here] if any(kind["kind"] is None for kind in need["dep_kinds"])]
    others = [packages[key] for key in seen if packages[key]["source"] is not None]
    return sorted(others, key=lambda package: (package["name"], package["version"]))


def texts(package: dict[str, Any]) -> list[str]:
    """Return the texts under which a crate is used."""
    folder = Path(package["manifest_path"]).parent
    entries = [*folder.iterdir(), *(folder / "LICENSES").glob("*")]
    files = [path for path in sorted(entries) if path.is_file() and path.name.upper().startswith((*NAMES, "MIT"))]
    chosen = [path for path in files if "MIT" in path.name.upper()]
    if chosen and " AND " not in package["license"]:
        files = chosen
    found = [
        "\n".join(line.rstrip() for line in path.read_text(encoding="utf-8").strip().splitlines()) for path in files
    ]
    return list(dict.fromkeys(found))


def page() -> str:
    """Return the whole file; crates with the same text stand over it together."""
    together: dict[tuple[str, ...], list[dict[str, Any]]] = {}
    for package in linked(metadata()):
        together.setdefault(tuple(texts(package)), []).append(package)
    parts = [HEAD]
    for told, packages in together.items():
        names = [f"{package['name']} {package['version']} ({package['license']})" for package in packages]
        body = told or ("The crate has no file with its licence; the expression stands above.",)
        parts += ["=" * 100, *names, "-" * 100, *"\n\n".join(body).splitlines(), ""]
    return "\n".join(parts).rstrip() + "\n"


if __name__ == "__main__":
    FILE.write_text(page(), encoding="utf-8")
