# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
#   docker build -t tissueform .
#   docker run --rm -p 127.0.0.1:50051:50051 -v tissueform:/var/lib/tissueform tissueform --host 0.0.0.0
#
# The volume holds what the server has acknowledged; --in-memory does without.
#
# The gateway for browsers (docs/gateway.md) is in the same image, for a container of its own:
#   docker run --rm -p 127.0.0.1:8080:8080 --entrypoint tissueform-gateway tissueform --server SERVER:50051 --listen 0.0.0.0:8080 --web /usr/local/share/tissueform/web
#
# There is no login and no encryption yet: publish the ports on loopback only, as above.

FROM debian:12 AS builder
COPY deploy /src/deploy
WORKDIR /src
RUN deploy/install_packages.sh build && rm -rf /var/lib/apt/lists/*
COPY . .
RUN deploy/build_web.sh \
    && deploy/build.sh release tissueform-server tissueform-gateway \
    && cmake --install build/release --component server --prefix /opt/tissueform \
    && cmake --install build/release --component gateway --prefix /opt/tissueform

FROM debian:12-slim
COPY deploy/install_packages.sh deploy/packages.txt /tmp/tissueform/deploy/
RUN /tmp/tissueform/deploy/install_packages.sh run \
    && rm -rf /tmp/tissueform /var/lib/apt/lists/* \
    && useradd --system --no-create-home --shell /usr/sbin/nologin tissueform \
    && install -d -m 0700 -o tissueform -g tissueform /var/lib/tissueform
COPY --from=builder /opt/tissueform/ /usr/local/
USER tissueform
ENV XDG_STATE_HOME=/var/lib
VOLUME /var/lib/tissueform
EXPOSE 50051 8080
STOPSIGNAL SIGTERM
# Whether the port answers; orchestrators ask the standard gRPC health service instead.
HEALTHCHECK --interval=30s --timeout=3s CMD ["bash", "-c", "</dev/tcp/127.0.0.1/50051"]
ENTRYPOINT ["tissueform-server"]
