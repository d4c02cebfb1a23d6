# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Protocol files that are not ours, from Debian: GOOGLE_RPC_PROTOS is the folder of google/rpc/*.proto (errors with
# details), GRPC_PROTOS that of grpc/health/v1/health.proto.

find_path(GOOGLE_RPC_PROTOS google/rpc/error_details.proto
          PATHS /usr/share/gocode/src/github.com/gogo/googleapis /usr/share/googleapis)
find_path(GRPC_PROTOS grpc/health/v1/health.proto PATHS /usr/share/grpc-proto)
if(NOT GOOGLE_RPC_PROTOS OR NOT GRPC_PROTOS)
  message(FATAL_ERROR "google/rpc/error_details.proto or grpc/health/v1/health.proto is missing: install "
                      "golang-github-gogo-googleapis-dev and grpc-proto, or set GOOGLE_RPC_PROTOS and GRPC_PROTOS")
endif()
