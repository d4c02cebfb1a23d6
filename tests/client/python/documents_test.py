# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""What docs/python.md and the notebooks show runs as it is written."""

import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

import meshio
import nbclient
import nbconvert
import nbformat
import numpy as np
import tissueform
from programs import BIN, SOURCE
from tissueform import sample_bar

MAX_EXAMPLE_LINES = 15
MAX_IMPORT_SECONDS = 0.5


def python_blocks(path):
    return re.findall(r"```python\n(.*?)```", path.read_text(), re.DOTALL)


class ExampleTest(unittest.TestCase):
    def test_the_example_goes_from_a_mesh_to_a_deformed_mesh(self):
        example = python_blocks(SOURCE / "docs/python.md")[0]
        self.assertLessEqual(len(example.strip().splitlines()), MAX_EXAMPLE_LINES)
        points, tets = sample_bar()
        with tempfile.TemporaryDirectory() as folder:
            meshio.write_points_cells(f"{folder}/bar.vtu", points, [("tetra", tets)])
            environment = {**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}"}
            done = subprocess.run([sys.executable, "-c", example], cwd=folder, env=environment, stdout=subprocess.PIPE, text=True, check=True)
            bent = meshio.read(f"{folder}/bent.vtu")
        self.assertRegex(done.stdout, "True")
        top = points[:, 2] == points[:, 2].max()
        np.testing.assert_allclose(bent.points[top] - points[top], np.tile([0, 4, 0], (top.sum(), 1)), atol=1e-5)
        self.assertEqual(len(bent.point_data["displacement_mm"]), len(points))

    def test_every_block_is_python_that_names_what_there_is(self):
        for block in [*python_blocks(SOURCE / "docs/python.md"), tissueform.__doc__.split("\n\n")[2]]:
            for name in re.findall(r"\btissueform\.(\w+)", block):
                self.assertTrue(hasattr(tissueform, name), name)

    def test_everything_public_has_a_docstring(self):
        for name in tissueform.__all__:
            thing = getattr(tissueform, name)
            if callable(thing):
                self.assertTrue(thing.__doc__, name)
                if isinstance(thing, type) and not issubclass(thing, Exception):
                    methods = [method for key, method in vars(thing).items() if callable(method) and not key.startswith("_")]
                    self.assertTrue(all(method.__doc__ for method in methods), name)


class SpeedTest(unittest.TestCase):
    def test_import_is_fast(self):
        def seconds(modules):  # of the processor: other programs of the machine do not count
            script = f"import time; start = time.process_time(); import {modules}; print(time.process_time() - start)"
            return float(subprocess.run([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, check=True).stdout)
        self.assertLessEqual(min(seconds("tissueform") for _ in range(3)), MAX_IMPORT_SECONDS)


class NotebookTest(unittest.TestCase):
    def run_notebook(self, name):
        """The text of its outputs. Writes a page of it beside the other documentation."""
        notebook = nbformat.read(SOURCE / "docs/examples/python" / name, as_version=4)
        for cell in notebook.cells:
            self.assertFalse(cell.get("outputs"), "stored without outputs, which could hold anything")
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, "-m", "ipykernel", "install", "--prefix", folder, "--name", "venv"], check=True, capture_output=True)
            environment = {"PATH": f"{BIN}:{os.environ['PATH']}", "JUPYTER_PATH": f"{folder}/share/jupyter", "PYDEVD_DISABLE_FILE_VALIDATION": "1",
                           "TISSUEFORM_SOURCE": str(SOURCE), "MPLCONFIGDIR": folder, "TMPDIR": folder, "IPYTHONDIR": folder, "HOME": folder}
            with unittest.mock.patch.dict(os.environ, environment):
                nbclient.NotebookClient(notebook, timeout=120, kernel_name="venv", resources={"metadata": {"path": folder}}).execute()
        page, _ = nbconvert.HTMLExporter().from_notebook_node(notebook)
        pages = BIN.parent.parent / "docs/examples"
        pages.mkdir(parents=True, exist_ok=True)
        (pages / name).with_suffix(".html").write_text(page)
        return json.dumps(notebook.cells)

    def test_the_bar_is_dragged(self):
        self.assertIn("final frame: converged True", self.run_notebook("drag_a_bar.ipynb"))

    def test_the_stiffness_study_draws_a_plot(self):
        text = self.run_notebook("stiffness_study.ipynb")
        self.assertIn("image/png", text)
        self.assertRegex(text, r"ratio 32: tip moves \d")

    def test_a_ct_leads_to_a_plan_and_a_face(self):
        text = self.run_notebook("ct_to_face.ipynb")
        self.assertIn("image/png", text)
        self.assertIn("handle  mandible", text)
        self.assertRegex(text, r"jaw 6 mm forward: skin of the chin 5\.\d mm")

    def test_labels_lead_to_a_plan_and_a_face(self):
        text = self.run_notebook("labels_to_face.ipynb")
        self.assertIn("image/png", text)
        self.assertRegex(text, r"lower jaw with teeth: Dice 0\.9")
        self.assertRegex(text, r"jaw 8 mm forward: skin of the chin 7\.\d mm")

    def test_a_cohort_is_compared_with_the_operated_faces(self):
        text = self.run_notebook("cohort.ipynb")
        self.assertIn("image/png", text)
        self.assertRegex(text, r"lower lip, planned: \d\.\d mm nearer than no prediction, p = 0\.125 \(4 pairs\)")


if __name__ == "__main__":
    unittest.main()
