# SPDX-License-Identifier: Apache-2.0
# Sunpoint with everything that its verbs need, for linux/amd64 (with ROS 2 from PyPI) and linux/arm64 (analysis alone).
#
#   docker build -t sunpoint .
#   docker run --rm -v "$PWD/bags:/sunpoint/bags" sunpoint replay bags/mine --estimators ekf

# The machine alone, on which .devcontainer mounts a checkout that sets itself up.
FROM debian:bookworm-slim AS machine

# What is left of versions is Debian's choice: each release has one of each, with its security fixes.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends ca-certificates g++ git python3 python3-dev python3-venv \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --uid 1000 --create-home --shell /bin/bash sunpoint \
    && install --directory --owner=1000 --group=1000 /sunpoint
USER 1000

FROM machine

WORKDIR /sunpoint
COPY --chown=1000:1000 . .
# Installs and builds once; kernels are compiled by the first flight of each kind.
RUN ./sunpoint shell -c true

ENTRYPOINT ["./sunpoint"]
CMD ["--help"]
