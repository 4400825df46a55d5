# Image of outrider, see docs/docker.md. Not built where the project is developed.
FROM python:3.12-slim AS build
WORKDIR /src
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
RUN python -m venv /opt/outrider
COPY requirements.txt pyproject.toml README.md LICENSE ./
RUN /opt/outrider/bin/pip install --require-hashes -r requirements.txt
COPY companion companion
COPY sitl sitl
COPY mavlink_bridge mavlink_bridge
COPY tools tools
COPY config config
RUN /opt/outrider/bin/pip install --no-deps --no-build-isolation .
# The planner and the physics are compiled once, into the cache beside the packages.
RUN /opt/outrider/bin/outrider swarm antipodal-8 --vehicles 2 --replan-hz 10 --out "$(mktemp -d)" || test $? -eq 1

FROM python:3.12-slim
COPY --from=build /opt/outrider /opt/outrider
RUN useradd --create-home outrider
USER outrider
WORKDIR /home/outrider
ENV PATH=/opt/outrider/bin:$PATH
ENTRYPOINT ["outrider"]
CMD ["--help"]
