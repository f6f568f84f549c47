"""`python -m audit`: licences of both lock files, then advisories as far as they can be had."""

from __future__ import annotations

import sys

from audit.advisories import crate_advisories, package_advisories
from audit.licences import BUNDLED, bundling, crate_licences, package_licences, wrong_licences


def main() -> None:
    """Check all that can be checked here, and say what cannot."""
    failed = False
    for what, found in (("crates", crate_licences()), ("packages", package_licences())):
        wrong = wrong_licences(found)
        print(f"licences of {what}: {len(found)} looked at, {len(wrong)} not allowed")
        print("".join(f"  {line}\n" for line in wrong), end="")
        failed |= bool(wrong)
    for name in bundling():
        print(f"  {name}: {BUNDLED.get(name, 'its wheel carries libraries that nobody looked at')}")
        failed |= name not in BUNDLED
    for what, report in (("packages", package_advisories()), ("crates", crate_advisories())):
        print(f"advisories of {what}: {report.said}")
        print("".join(f"  {line}\n" for line in report.found), end="")
        failed |= bool(report.found)
    sys.exit(1 if failed else 0)


main()
