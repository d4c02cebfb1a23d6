# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Predicts soft tissue after jaw surgery on a tissueform-server, with numpy arrays in and out.

    import tissueform
    from tissueform import Pose

    points, tets = tissueform.sample_bar()
    z = points[:, 2]
    with tissueform.local() as server, server.connect() as client:
        mesh = client.upload_mesh(points, tets, stiffness=5000.0)
        with client.create_session(mesh, fixed=z == z.min(), handles={"end": z == z.max()}) as session:
            prediction = session.predict({"end": Pose(translation_mm=(0, 4, 0))})

Begin with connect (a server elsewhere) or local (one of this machine); then Client, Session, Drag and Prediction explain themselves:
help(tissueform.Session). Lengths are in mm, angles in radians, stiffness in Pa; vertices and tets count from 0; meshes are in LPS.
Errors are TissueformError with reason, message and advice. The messages of the protocol are in tissueform.v1.

Research software, not a medical device: not for diagnosis or treatment.
"""

from ._versions import check_libraries

check_libraries()

from ._channel import Tls  # noqa: E402  (the libraries are checked first)
from .adaptors import from_meshio, from_nibabel, to_meshio, to_pyvista  # noqa: E402
from .async_drag import AsyncDrag  # noqa: E402
from .client import Client, ServerInfo, connect  # noqa: E402
from .dicom import from_dicom  # noqa: E402
from .doctor import DoctorLine, doctor  # noqa: E402
from .drag import Drag  # noqa: E402
from .errors import (AccessDenied, Cancelled, Conflict, DataDamaged, DeadlineExceeded, InvalidInput, LimitExceeded,  # noqa: E402
                     NotFound, ServerError, ServerUnavailable, TissueformError, Unauthenticated)
from .fitting import Fit, FitTarget, FittedTarget, Freedom  # noqa: E402
from .local import LocalServer, local  # noqa: E402
from .meshes import Mesh, boundary_triangles  # noqa: E402
from .outcomes import outcome, outcome_cohort  # noqa: E402
from .plan_builds import BuiltPlan  # noqa: E402
from .plans import Plan, read_plan  # noqa: E402
from .poses import Pose, ras_to_lps  # noqa: E402
from .predictions import Frame, MaterialRanges, Prediction, Prepared  # noqa: E402
from .prepared_answers import PreparedAnswers  # noqa: E402
from .sample_meshes import sample_bar  # noqa: E402
from .sessions import FIXED_BONE, ContactRow, LipEdge, Session  # noqa: E402
from .stored_predictions import Export, Measure, StoredPrediction  # noqa: E402
from .volumes import Volume  # noqa: E402

__all__ = [
    "AccessDenied", "AsyncDrag", "BuiltPlan", "Cancelled", "Client", "Conflict", "ContactRow", "DataDamaged", "DeadlineExceeded",
    "DoctorLine", "Drag", "Export", "FIXED_BONE", "Fit", "FitTarget", "FittedTarget", "Frame", "Freedom", "InvalidInput", "LimitExceeded", "LipEdge",
    "LocalServer", "MaterialRanges", "Measure", "Mesh", "NotFound", "Plan", "Pose", "Prediction", "Prepared", "PreparedAnswers",
    "ServerError", "ServerInfo", "ServerUnavailable", "Session", "StoredPrediction", "Tls", "TissueformError", "Unauthenticated", "Volume",
    "boundary_triangles", "connect", "doctor", "from_dicom", "from_meshio", "from_nibabel", "local", "outcome", "outcome_cohort", "ras_to_lps", "read_plan",
    "sample_bar", "to_meshio", "to_pyvista",
]
