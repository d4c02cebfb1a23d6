# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Plans that the server builds from a CT or from surfaces."""

from __future__ import annotations

import hashlib
import io
import json
import os
import pathlib
import time
import zipfile
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Tuple, Union

import grpc

from ._calls import Backoff, Caller, new_id
from ._channel import PathLike
from ._uploads import CHUNK_BYTES, Progress, report, send_resumable
from .errors import Cancelled, Conflict, DataDamaged, InvalidInput, NotFound, ServerUnavailable, error_of_call, is_transient
from .v1 import plan_build_service_pb2, plan_build_service_pb2_grpc
from .volumes import Volume, file_of

VolumeLike = Union[Volume, PathLike]
RecipeLike = Union[Mapping[str, Any], PathLike]
Files = Mapping[str, Union[PathLike, bytes]]
StageProgress = Callable[[str, float], None]

_SUFFIXES = (".stl", ".ply", ".obj", ".vtp", ".json", ".tfm", ".h5")
_NO_DATE = (1980, 1, 1, 0, 0, 0)  # the first that a zip can state: the same files are the same bytes
_UPLOAD_SHARE = 0.15  # of the whole
_WATCH_PATIENCE_SECONDS = 60.0


class BuiltPlan:
    """A plan that the server has built, with its case. Made by Client.build_plan and build_plan_from_surfaces.

    name: "planBuilds/{id}". case: "cases/{sha256}", for planners. is_ready: whether the plan meets all requirements; defects: which it
    misses, and by how much. summary: what was made and what to mind, as `tissueform plan build` prints it. files: paths of its files, such
    as "plan.json" and "report.html"; the server keeps them until expire_time of description (v1.PlanBuild).
    """

    def __init__(self, calls: "PlanBuildCalls", message: plan_build_service_pb2.PlanBuild) -> None:
        self._calls = calls
        self.description = message
        self.name: str = message.name
        self.case: str = message.case
        self.is_ready: bool = message.is_ready
        self.defects: str = message.defects
        self.summary: str = message.summary
        self.files: Tuple[str, ...] = tuple(file.path for file in message.files)

    def __repr__(self) -> str:
        return f"BuiltPlan({self.name!r}, case={self.case!r}, is_ready={self.is_ready})"

    def read(self, path: str) -> bytes:
        """One of files. Errors: NotFound, DataDamaged."""
        return self._calls.read(self.name, path)

    def save(self, folder: PathLike) -> pathlib.Path:
        """Writes all files into a new or empty folder and returns the path of plan.json, for read_plan. Errors: InvalidInput (the folder),
        those of read."""
        target = pathlib.Path(folder)
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise InvalidInput("the folder for the plan is not empty", advice="give a new or an empty one")
        for path in self.files:
            parts = pathlib.PurePosixPath(path).parts
            if not parts or path.startswith("/") or ".." in parts:
                raise DataDamaged("the server names a file by a path that leads out of the plan's folder")
            data = self.read(path)
            file = target.joinpath(*parts)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
        return target / "plan.json"

    def delete(self) -> None:
        """Removes the build and its files from the server; the case stays. Errors: NotFound."""
        self._calls.delete(self.name)


class FilePayload:
    """A file as it is sent."""

    def __init__(self, suffix: str, data: bytes) -> None:
        self._data = data
        self.total_bytes = len(data)
        self.failure: Optional[BaseException] = None
        self.header = plan_build_service_pb2.BuildFileHeader(sha256=hashlib.sha256(data).hexdigest(), total_bytes=len(data), suffix=suffix)
        self.name = f"buildFiles/{self.header.sha256}"

    def requests(self, begin: int, on_progress: Optional[Progress]) -> Iterator[Any]:
        yield plan_build_service_pb2.UploadBuildFileRequest(header=self.header)
        for at in range(begin, max(self.total_bytes, begin + 1), CHUNK_BYTES):
            data = self._data[at:at + CHUNK_BYTES]
            last = at + len(data) == self.total_bytes
            chunk = plan_build_service_pb2.BuildFileChunk(write_offset=at, data=data, finish_write=last)
            yield plan_build_service_pb2.UploadBuildFileRequest(chunk=chunk)
            report(self, on_progress, at + len(data))


def _named_files(recipe: Any, place: str = "") -> Iterator[str]:
    """Paths of the files that a recipe names, other than its label map, as it names them."""
    items = enumerate(recipe) if isinstance(recipe, list) else recipe.items() if isinstance(recipe, Mapping) else ()
    for key, value in items:
        here = f"{place}/{key}"
        if isinstance(value, str) and key in ("file", "transform", "mouth_line_file") and here != "/labels/file":
            yield value
        else:
            yield from _named_files(value, here)


def _read_recipe(recipe: RecipeLike, what: str = "recipe") -> Tuple[str, Any, Optional[pathlib.Path]]:
    """The text, what it says, and the folder of the file."""
    if isinstance(recipe, Mapping):
        try:
            return json.dumps(recipe), recipe, None
        except (TypeError, ValueError) as error:
            raise InvalidInput(f"the {what} cannot be made JSON: {error}") from error
    if not isinstance(recipe, (str, os.PathLike)):
        raise InvalidInput(f"the {what} is neither a dict nor the path of a file")
    path = pathlib.Path(recipe)
    try:
        text = path.read_text(encoding="utf-8")
        return text, json.loads(text), path.parent
    except OSError as error:
        raise NotFound(f"cannot read the {what}: {error.strerror}") from error
    except ValueError as error:
        raise InvalidInput(f"the {what} is not JSON: {error}") from error


def _bytes_of(name: str, files: Files, folder: Optional[pathlib.Path], what: str = "recipe") -> bytes:
    source = files.get(name, None if folder is None else folder / name)
    if source is None:
        raise NotFound(f'the {what} names the file "{name}"', advice="give it in files")
    if isinstance(source, bytes):
        return source
    try:
        return pathlib.Path(source).read_bytes()
    except OSError as error:
        raise NotFound(f'cannot read "{name}", which the {what} names: {error.strerror}') from error


def _recipe_files(recipe: Any, files: Files, folder: Optional[pathlib.Path]) -> Dict[str, FilePayload]:
    payloads = {}
    for name in sorted({*_named_files(recipe), *files}):
        suffix = pathlib.PurePosixPath(name).suffix.lower()
        if suffix not in _SUFFIXES:
            raise InvalidInput(f'the recipe\'s file "{name}" is not one of {" ".join(_SUFFIXES)}')
        payloads[name] = FilePayload(suffix, _bytes_of(name, files, folder))
    return payloads


def _zip_of_surfaces(surfaces: RecipeLike, files: Files) -> FilePayload:
    text, parsed, folder = _read_recipe(surfaces, "surfaces file")
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted({*_named_files(parsed), *files}):
            archive.writestr(zipfile.ZipInfo(name, _NO_DATE), _bytes_of(name, files, folder, "surfaces file"))
        archive.writestr(zipfile.ZipInfo("surfaces.json", _NO_DATE), text)
    return FilePayload(".zip", packed.getvalue())


class PlanBuildCalls:
    """The service of one server that builds plans."""

    def __init__(self, caller: Caller) -> None:
        self._caller = caller
        self._stub = caller.stub(plan_build_service_pb2_grpc.PlanBuildServiceStub)

    def build(self, ct: VolumeLike, recipe: RecipeLike, labels: Optional[VolumeLike], files: Optional[Files], title: str, project: str,
              on_progress: Optional[StageProgress]) -> BuiltPlan:
        """See Client.build_plan."""
        text, parsed, folder = _read_recipe(recipe)
        if labels is None and isinstance(parsed, Mapping) and isinstance(parsed.get("labels"), Mapping) and "file" in parsed["labels"]:
            if folder is None:
                raise NotFound("the recipe names a label map", advice="give it as labels")
            labels = folder / str(parsed["labels"]["file"])
        payloads = _recipe_files(parsed, files or {}, folder)
        volumes = [FilePayload(*file_of(ct, "CT"))]
        if labels is not None:
            volumes.append(FilePayload(*file_of(labels, "label map")))
        request = plan_build_service_pb2.CreatePlanBuildRequest(
            recipe_json=text, ct=volumes[0].name, labels=volumes[1].name if labels is not None else "", title=title, project=project,
            recipe_files=[plan_build_service_pb2.RecipeFile(path=name, file=payload.name) for name, payload in payloads.items()],
            request_id=new_id())
        return self._run([*payloads.values(), *volumes], request, on_progress)

    def build_from_surfaces(self, surfaces: RecipeLike, files: Optional[Files], title: str, project: str,
                            on_progress: Optional[StageProgress]) -> BuiltPlan:
        """See Client.build_plan_from_surfaces."""
        payload = _zip_of_surfaces(surfaces, files or {})
        request = plan_build_service_pb2.CreatePlanBuildRequest(surfaces=payload.name, title=title, project=project, request_id=new_id())
        return self._run([payload], request, on_progress)

    def _run(self, payloads: List[FilePayload], request: plan_build_service_pb2.CreatePlanBuildRequest,
             on_progress: Optional[StageProgress]) -> BuiltPlan:
        self._upload(payloads, on_progress)
        created = self._caller.unary(self._stub.CreatePlanBuild, request)
        try:
            done = self._wait(created.name, on_progress)
        except BaseException:
            self._cancel(created.name)
            raise
        return self._built(done)

    def _built(self, done: plan_build_service_pb2.PlanBuild) -> BuiltPlan:
        if done.state == plan_build_service_pb2.PLAN_BUILD_STATE_CANCELLED:
            raise Cancelled("the build was canceled on the server")
        if done.state != plan_build_service_pb2.PLAN_BUILD_STATE_SUCCEEDED:
            raise Conflict(done.detail or "the build failed", advice="correct what the message names, and build again")
        return BuiltPlan(self, done)

    def _upload(self, payloads: List[FilePayload], on_progress: Optional[StageProgress]) -> None:
        total, before = sum(payload.total_bytes for payload in payloads), 0
        for payload in payloads:
            def report_sent(sent: int, _: int, before: int = before) -> None:
                if on_progress is not None:
                    on_progress("uploading", _UPLOAD_SHARE * (before + sent) / total)
            self._send(payload, report_sent)
            before += payload.total_bytes

    def _send(self, payload: FilePayload, on_progress: Progress) -> None:
        committed = 0

        def committed_bytes() -> int:
            nonlocal committed
            request = plan_build_service_pb2.GetBuildFileRequest(name=payload.name)
            try:
                found = self._stub.GetBuildFile(request, timeout=self._caller.call_timeout, metadata=self._caller.metadata(""))
            except grpc.RpcError as raised:
                if not isinstance(error_of_call(raised), (NotFound, DataDamaged)):
                    raise
                found = plan_build_service_pb2.BuildFile()
            committed = int(found.committed_bytes) if found.total_bytes == payload.total_bytes else 0
            return committed

        def call(requests: Iterator[Any]) -> Any:
            if committed == payload.total_bytes:
                return None  # the server has all of it
            return self._stub.UploadBuildFile(requests, timeout=self._caller.call_timeout, metadata=self._caller.metadata(""))
        send_resumable(payload, committed_bytes, call, on_progress)

    def _wait(self, name: str, on_progress: Optional[StageProgress]) -> Any:
        """The build when it is done. Continues when the connection breaks or the server starts again."""
        backoff, give_up = Backoff(), time.monotonic() + _WATCH_PATIENCE_SECONDS
        while True:
            call = self._stub.WatchPlanBuild(plan_build_service_pb2.WatchPlanBuildRequest(name=name), metadata=self._caller.metadata(""))
            try:
                for build in call:
                    give_up = time.monotonic() + _WATCH_PATIENCE_SECONDS
                    backoff.reset()
                    if build.state >= plan_build_service_pb2.PLAN_BUILD_STATE_SUCCEEDED:
                        return build
                    if on_progress is not None:
                        on_progress(build.stage or "waiting", _UPLOAD_SHARE + (1 - _UPLOAD_SHARE) * build.fraction)
                raise ServerUnavailable("the server ended the watch before the build")
            except grpc.RpcError as raised:
                error = error_of_call(raised)
            except ServerUnavailable as ended:
                error = ended
            finally:
                call.cancel()
            wait = backoff.after(error)
            if not is_transient(error) or time.monotonic() + wait > give_up:
                raise error
            time.sleep(wait)

    def _cancel(self, name: str) -> None:
        """For a caller that no longer waits: an error of this call would hide the reason."""
        try:
            self._stub.CancelPlanBuild(plan_build_service_pb2.CancelPlanBuildRequest(name=name), timeout=5, metadata=self._caller.metadata(""))
        except grpc.RpcError:
            pass

    def read(self, name: str, path: str) -> bytes:
        def take(responses: Iterator[Any]) -> bytes:
            data, total = bytearray(), 0
            for response in responses:
                if response.offset != len(data):
                    raise DataDamaged("the file came with a gap", advice="read it again")
                data += response.data
                total = response.total_bytes
            if len(data) != total:
                raise DataDamaged("the file is not complete", advice="read it again")
            return bytes(data)
        return self._caller.stream(self._stub.ReadPlanBuildFile, plan_build_service_pb2.ReadPlanBuildFileRequest(name=name, path=path), take)

    def delete(self, name: str) -> None:
        self._caller.delete(self._stub.DeletePlanBuild, plan_build_service_pb2.DeletePlanBuildRequest(name=name))
