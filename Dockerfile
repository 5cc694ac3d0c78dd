# randt without an installation: the command line and all stages, on Debian 12.
#
#   docker build -t randt .
#   docker run --rm -v "$PWD:/data" randt run DRIVE.bag --out results
#   docker run --rm --network host --shm-size 256m -v "$PWD:/data" randt up --robot robot.toml --out live
#
# Shared memory lives in the container: `randt top` is `docker exec CONTAINER randt top`.
FROM rust:1.95-slim-bookworm AS build
WORKDIR /src
COPY . .
# The context has no git: the commit is what `--version` shows.
ARG RANDT_COMMIT=unknown
ENV CARGO_PROFILE_RELEASE_STRIP=symbols
# Names of the packages as in systemd/package/programs.
RUN cargo build --locked --release $(sed 's/^/--package=/' systemd/package/programs) --package=randt-c \
    && install -D -t /out/bin $(sed 's|^|target/release/|' systemd/package/programs) \
    && install -D -m 644 -t /out/lib target/release/librandt_bus.so

FROM debian:12-slim
COPY --from=build /out/ /usr/local/
# Files that it writes belong to the user who has number 1000 outside; another one: --user "$(id -u)".
RUN ldconfig && useradd --uid 1000 randt
USER randt
WORKDIR /data
ENTRYPOINT ["randt"]
CMD ["--help"]
