# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Server and gateway from their Debian packages, for a container each. deploy/build_image.sh builds and tries it.
#
#   docker build -t tissueform .
#   docker run --rm -p 127.0.0.1:50051:50051 -v tissueform:/var/lib/tissueform tissueform --host 0.0.0.0 --insecure
#
# The volume holds what the server has acknowledged; --in-memory does without. Whoever reaches the port is let in: publish
# it on loopback only, as above, or leave --insecure out and give TLS and tokens (docs/operations.md), as options, as
# -e TISSUEFORM_SERVER_..., or in a file that is mounted.
#
# deploy/compose.yaml starts both. The gateway for browsers (docs/gateway.md):
#   docker run --rm -p 127.0.0.1:8080:8080 --entrypoint tissueform-gateway -v /PATH/ca.pem:/ca.pem:ro tissueform --server SERVER:50051 --server-ca /ca.pem --listen 0.0.0.0:8080 --web /usr/share/tissueform/web

FROM debian:12 AS builder
COPY deploy /src/deploy
WORKDIR /src
RUN deploy/install_packages.sh build web && rm -rf /var/lib/apt/lists/*
COPY . .
ARG JOBS
# The secret, which need not be there: authorities that npm shall trust beside its own, where a proxy looks into TLS.
RUN --mount=type=secret,id=authorities \
    if [ -e /run/secrets/authorities ]; then export NODE_EXTRA_CA_CERTS=/run/secrets/authorities; fi \
    && deploy/build_web.sh \
    && TISSUEFORM_BUILD_DIR=/src/build/release deploy/build.sh programs tissueform-server tissueform-gateway \
    && deploy/build_packages.sh /packages tissueform-server tissueform-gateway

FROM debian:12-slim
COPY --from=builder /packages/ /packages/
RUN apt-get update -qq \
    && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends /packages/*.deb \
    && rm -rf /packages /var/lib/apt/lists/* /var/cache/apt/*.bin
USER tissueform
ENV XDG_STATE_HOME=/var/lib
VOLUME /var/lib/tissueform
EXPOSE 50051 8080
STOPSIGNAL SIGTERM
# Whether the port answers; orchestrators ask the standard gRPC health service instead.
HEALTHCHECK --interval=30s --timeout=3s CMD ["bash", "-c", "</dev/tcp/127.0.0.1/50051"]
ENTRYPOINT ["tissueform-server"]
