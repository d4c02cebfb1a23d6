// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>

namespace tissueform::fuzz {

// A fuzz target takes any bytes. It ends the program (through a sanitizer, an assertion or
// std::abort) when the code under test breaks a promise, and only then.

// The text of a plan file (ParsePlan); what is accepted must keep the promises of the format.
void FuzzPlan(const uint8_t* data, size_t size);

// A mesh out of raw bytes, with any indices and any floating-point numbers (TetMesh::Create,
// ValidateTetMesh, RepairOrientation, ValidateTriangleMesh of its boundary).
void FuzzMeshValidation(const uint8_t* data, size_t size);

// A shape and chunks of a payload (core/mesh/payload) as a server takes them from the network, and
// the mesh that comes of them.
void FuzzMeshPayload(const uint8_t* data, size_t size);

// The headers of a folder of DICOM files, as they come from the helper program in which GDCM reads
// them (ChooseSeries, ArrangeStack).
void FuzzDicomSeries(const uint8_t* data, size_t size);

// The text at the head of a file of NRRD or MetaImage, and the size of what is compressed in one of
// NIfTI (ReadVolumeHeader, UnpackedSize): no header chooses a file in another folder.
void FuzzVolumeHeader(const uint8_t* data, size_t size);

// Names of segments in NRRD and NIfTI, and the frames of a DICOM SEG (AssignStructures,
// ArrangeSegFrames): messages are printable lines, and every frame is in the grid.
void FuzzLabels(const uint8_t* data, size_t size);

// The text of a recipe (ParseRecipe), as FuzzPlan.
void FuzzRecipe(const uint8_t* data, size_t size);

// A step and packed displacements as a client takes them from the network (DecodeDisplacements).
void FuzzDisplacements(const uint8_t* data, size_t size);

// A case, or a plan's surfaces for viewers (ParseCase, ParseViewer): what is accepted can be
// written again, and no number in it leads outside.
void FuzzCaseFile(const uint8_t* data, size_t size);

// A MEDIT text, before Gmsh sees it (CheckMeditLines).
void FuzzMeditLines(const uint8_t* data, size_t size);

// What clients send to DeformService: messages of drags and watches as they come from the network,
// each after a byte that says of what and its length; the first byte may also end the drag, begin
// another, take the session out of memory or drain the server. Every call ends with a code of its
// rpc and a reason, and no number of an answer is infinite or none.
void FuzzDeformStream(const uint8_t* data, size_t size);

// Messages of an UploadCase stream, and parts of cases that are read. What is kept must be what its
// name says.
void FuzzCaseUpload(const uint8_t* data, size_t size);

// Prepared answers as bytes (ReadAnswers), and poses for those that are accepted (AnswerEvaluator).
void FuzzAnswers(const uint8_t* data, size_t size);

// What a browser sends on a connection to a gateway in this process: requests, or, where the first
// byte is odd, frames of a WebSocket that was opened. The gateway ends the connection after the
// client has, and serves the next one.
void FuzzGatewayConnection(const uint8_t* data, size_t size);

// One message of a WebSocket as the gateway takes it from a browser, as a start's payload, and as a
// message of a server whose longest bytes are looked for (ParseClientFrame, ParseStart,
// MessageFrame): what is accepted may be given to gRPC.
void FuzzSocketFrame(const uint8_t* data, size_t size);

// Path, metadata, timeout and body of a request of gRPC-Web, each of the first five after a byte
// that says its length (ParseWebRequest, MetadataOf, ParseGrpcTimeout), and the end of a call with
// the body as its message.
void FuzzWebRequest(const uint8_t* data, size_t size);

// Rows of a store's database and announcements of uploads, the first byte says of what
// (ParseRecord, ParsePoses, ParseMesh, ParseAnnouncement, ParsePrediction, Unseal,
// ParseCaseRecord): what is accepted comes back from its own bytes.
void FuzzStoreRecord(const uint8_t* data, size_t size);

// Authorization headers, one a line, and the bytes as a token, as its header and as its claims
// (BearerToken, SplitToken, ReadTokenHeader, ReadTokenClaims).
void FuzzToken(const uint8_t* data, size_t size);

// A key set, or PEM keys, and a revocation list (KeySet::Parse, RevocationList::Parse).
void FuzzTokenKeys(const uint8_t* data, size_t size);

// The body of a WADO-RS answer (MultipartSplitter): the same in pieces of any size.
void FuzzMultipart(const uint8_t* data, size_t size);

// A DICOM file as the PACS bridge reads it (ReadInstanceHeader).
void FuzzInstanceHeader(const uint8_t* data, size_t size);

// A zip (ReadZip): nothing is written outside its folder or beyond the limits. The bytes are a name
// in a zip as well (PartsOfZipName).
void FuzzZip(const uint8_t* data, size_t size);

// The text of an ITK transform file (ParseItkTransform): what is accepted is rigid.
void FuzzTransform(const uint8_t* data, size_t size);

// The text of a markups file of 3D Slicer (ParseMarkups).
void FuzzMarkups(const uint8_t* data, size_t size);

}  // namespace tissueform::fuzz
