# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Licenses of Debian packages as SPDX expressions, read from /usr/share/doc/PACKAGE/copyright (DEP-5).

Only the paragraph `Files: *` counts: it is the license that the project itself states. Other files of the source, such as
build scripts, may have other licenses; the copyright file names them.
"""

import re

# Names that Debian's copyright files use, in lower case; SPDX writes them differently.
SPDX_NAMES = {
    "agpl3+": "AGPL-3.0-or-later", "apache-2-llvm-exceptions": "Apache-2.0 WITH LLVM-exception", "apache-2.0": "Apache-2.0", "bsd-2-clause": "BSD-2-Clause", "bsd-2clause": "BSD-2-Clause",
    "bsd-3-clause": "BSD-3-Clause", "bsd-3-clause~google": "BSD-3-Clause", "bsd-3-google": "BSD-3-Clause", "bsd3": "BSD-3-Clause",
    "bsl-1.0": "BSL-1.0", "cc0-1.0": "CC0-1.0", "cddl-1.0": "CDDL-1.0", "curl": "curl", "expat": "MIT", "ftl": "FTL", "gpl-2": "GPL-2.0-only",
    "gpl-2+": "GPL-2.0-or-later", "gpl-2.0": "GPL-2.0-only", "gpl-2.0+": "GPL-2.0-or-later", "gpl-3.0": "GPL-3.0-only",
    "gpl-3+": "GPL-3.0-or-later", "lgpl-2.1": "LGPL-2.1-only", "lgpl-2.1+": "LGPL-2.1-or-later", "lgpl-3+": "LGPL-3.0-or-later",
    "lgpl-3.0+": "LGPL-3.0-or-later", "mit": "MIT", "mit-1": "MIT", "mpl-2": "MPL-2.0", "mpl-2.0": "MPL-2.0",
    "openldap-2.8": "OLDAP-2.8", "postgresql": "PostgreSQL", "zlib": "Zlib",
}
REFERENCE = re.compile(r"[^A-Za-z0-9.-]+")


def stated_license(copyright_text):
    """The words after `License:` in the paragraph `Files: *`; None where the file is free text or has no such paragraph."""
    if not re.match(r"\s*format", copyright_text, re.IGNORECASE):
        return None
    for paragraph in re.split(r"\n\s*\n", copyright_text):
        if re.search(r"^Files:\s*\*\s*$", paragraph, re.MULTILINE):
            found = re.search(r"^License:[ \t]*(\S.*?)\s*$", paragraph, re.MULTILINE)
            return found and found[1]
    return None


def spdx_term(name):
    """One license; those that SPDX does not list, and those with an exception in words, become a LicenseRef."""
    return SPDX_NAMES.get(name.lower()) or "LicenseRef-Debian-" + REFERENCE.sub("-", name).strip("-")


def spdx_expression(stated):
    """`GPL-2+ or LGPL-3+` becomes `GPL-2.0-or-later OR LGPL-3.0-or-later`; None becomes NOASSERTION."""
    if not stated:
        return "NOASSERTION"
    # In Debian's files a comma before the word binds less than the word; none of ours has one, and NOASSERTION is true then.
    if "," in stated:
        return "NOASSERTION"
    parts = re.split(r" (or|and) ", stated)
    if "or" in parts[1::2] and "and" in parts[1::2]:
        return "NOASSERTION"
    return " ".join(part.upper() if i % 2 else spdx_term(part) for i, part in enumerate(parts))
