# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The types of the module's logic: mypy --strict, with those of the installed package."""

import pathlib
import subprocess
import tempfile
import unittest

import tissueform
from head_scene import MODULE

SETTINGS = """[mypy]
strict = True
python_version = 3.9
[mypy-slicer.*,vtk.*,grpc.*,google.*,meshio.*,pyvista.*,vtkmodules.*]
ignore_missing_imports = True
[mypy-pydicom.*,pkg_resources.*]
follow_imports = skip
[mypy-tissueform.v1.*]
ignore_errors = True
"""


class TypesTest(unittest.TestCase):
    def test_the_logic_has_types_without_errors(self):
        with tempfile.TemporaryDirectory() as folder:
            settings = pathlib.Path(folder, "mypy.ini")
            settings.write_text(SETTINGS)
            done = subprocess.run(["mypy", "--config-file", settings, "--cache-dir", folder, "-p", "TissueformLib"], cwd=MODULE,
                                  env={"PATH": "/usr/bin:/bin", "MYPYPATH": str(pathlib.Path(tissueform.__file__).parents[1])},
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.assertEqual(done.returncode, 0, done.stdout)


if __name__ == "__main__":
    unittest.main()
