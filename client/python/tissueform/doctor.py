# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""What works between here and a server, from its name to a drag. The twin of `tissueform doctor`."""

from __future__ import annotations

import dataclasses
import platform
import random
import socket
import time
from importlib import metadata
from typing import Any, Callable, List, Optional, Union

import numpy as np

from ._channel import Tls
from ._versions import library_versions
from .client import Client, connect
from .errors import TissueformError
from .poses import Pose
from .v1 import access_service_pb2, access_service_pb2_grpc

_TCP_SECONDS = 5.0
# Servers allow a token 30 s; a difference of less than 5 s is not worth a line.
_NOTICED_SECONDS, _LEEWAY_SECONDS = 5.0, 30.0


@dataclasses.dataclass(frozen=True)
class DoctorLine:
    """finding: "ok", "warning" or "failed". advice: what to do; empty where there is nothing to do."""

    check: str
    finding: str
    text: str
    advice: str = ""

    def __str__(self) -> str:
        finding = self.finding.upper() if self.finding == "failed" else self.finding
        line = f"{finding:<8} {self.check:<11} {self.text}"
        return f"{line}\n{'':20} -> {self.advice}" if self.advice else line


def _check_libraries() -> DoctorLine:
    """Older ones are refused when the package is imported."""
    found = [f"Python {platform.python_version()}", f"tissueform {metadata.version('tissueform')}"]
    found += [f"{name} {version}" for name, version in library_versions().items()]
    return DoctorLine("libraries", "ok", ", ".join(found))


def _check_route(address: str) -> DoctorLine:
    host, _, port = address.rpartition(":")
    start = time.monotonic()
    try:
        socket.create_connection((host.strip("[]"), int(port)), _TCP_SECONDS).close()
    except (OSError, ValueError) as error:
        return DoctorLine("route", "failed", f"no connection to {address}: {error}",
                          "check the spelling, whether the server runs on this port, this machine's DNS, firewall and VPN")
    return DoctorLine("route", "ok", f"{address} accepts connections, in {1000 * (time.monotonic() - start):.1f} ms")


def _check_login(client: Client) -> List[DoctorLine]:
    stub = client._caller.stub(access_service_pb2_grpc.AccessServiceStub)
    asked = time.time()
    caller = client._caller.unary(stub.WhoAmI, access_service_pb2.WhoAmIRequest())
    skew = caller.server_time.seconds + 1e-9 * caller.server_time.nanos - (asked + time.time()) / 2
    who = f"you are logged in as {caller.principal}" if caller.principal else "the server does not require authentication"
    finding = "ok" if abs(skew) <= _NOTICED_SECONDS else "warning" if abs(skew) <= _LEEWAY_SECONDS else "failed"
    advice = "" if finding == "ok" else "synchronize both clocks with NTP: the server's clock decides whether a token is valid"
    return [DoctorLine("login", "ok", who),
            DoctorLine("clock", finding, f"the server's is {abs(skew):.1f} s {'behind' if skew < 0 else 'ahead'}", advice)]


def _check_server(client: Client) -> List[DoctorLine]:
    info, own = client.info(), metadata.version("tissueform")
    differs = info.version != own
    lines = [DoctorLine("version", "warning" if differs else "ok", f"server {info.version}, this package {own}, protocol {info.api_version}",
                        "they are compatible; for all features install the same version" if differs else "")]
    limits = info.limits
    lines.append(DoctorLine("limits", "ok", f"meshes up to {limits.get('max_vertices', 0)} vertices, {limits.get('max_sessions', 0)} sessions in "
                                            f"memory, {limits.get('max_streams', 0)} drags at once"))
    if info.draining:
        lines.append(DoctorLine("limits", "failed", "the server is shutting down and accepts no new work", "try again in a minute"))
    return lines


def _check_work(client: Client) -> List[DoctorLine]:
    """A mesh of two tets is uploaded, made a session, dragged, and deleted. Its name is its own each time."""
    start = time.monotonic()
    points = 10 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1 + random.random()]])
    mesh = client.upload_mesh(points, [[0, 1, 2, 3], [1, 2, 3, 4]], stiffness=1e4)
    try:
        with client.create_session(mesh, fixed=[0], handles={"far": [4]}) as session, session.drag() as drag:
            drag.move({"far": Pose(translation_mm=(0, 0, 1))})
    finally:
        client.delete_mesh(mesh)
    return [DoctorLine("work", "ok", f"a mesh was uploaded, dragged and deleted, in {1000 * (time.monotonic() - start):.0f} ms")]


def _lines_of(check: str, ask: Callable[[Client], List[DoctorLine]], client: Client) -> List[DoctorLine]:
    try:
        return ask(client)
    except TissueformError as error:
        return [DoctorLine(check, "failed", f"{error.message} ({error.reason})", error.advice)]


def doctor(address: Optional[str] = None, *, tls: Union[None, bool, Tls] = None, **options: Any) -> List[DoctorLine]:
    """Asks what works, in order; what cannot be asked because of a failure is left out. Without an address only the versions of this
    machine are named. Takes the options of connect. Prints nothing."""
    lines = [_check_libraries()]
    if address is None:
        return lines
    if not address.startswith("unix:"):
        lines.append(_check_route(address))
    if any(line.finding == "failed" for line in lines):
        return lines
    try:
        client = connect(address, tls=tls, **options)
    except TissueformError as error:
        return [*lines, DoctorLine("health", "failed", f"{error.message} ({error.reason})", error.advice)]
    with client:
        for check, ask in (("login", _check_login), ("version", _check_server), ("work", _check_work)):
            lines += _lines_of(check, ask, client)
            if any(line.finding == "failed" for line in lines):
                break
    return lines
