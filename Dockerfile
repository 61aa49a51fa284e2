# Images of the node, built from the root of the checkout:
#
#   docker build --target jazzy -t mtpgo_ros:jazzy .    # on ROS 2 Jazzy, built by colcon
#   docker build --target slim -t mtpgo_ros:slim .      # on slim Python, with ROS 2 as wheels
#
#   docker run --rm --net=host --ipc=host mtpgo_ros:jazzy ros2 launch mtpgo_ros demo.launch.py
#   docker run --rm mtpgo_ros:slim mtpgo demo
#
# PyTorch comes from the index of its CPU builds: the build that pip chooses by itself has CUDA,
# several GB that the node does not use.

FROM ros:jazzy-ros-base AS jazzy
# rosdep installs what package.xml depends on, except what requirements/robot.txt has by pip.
COPY package.xml /tmp/mtpgo_ros/package.xml
# hadolint ignore=DL3008
RUN apt-get update \
 && apt-get install -y --no-install-recommends python3-pip \
 && rosdep update --rosdistro jazzy \
 && rosdep install -y --rosdistro jazzy --from-paths /tmp/mtpgo_ros --ignore-src -t exec \
      --skip-keys "mcap-ros2-support python3-pytorch-pip python3-rosbags-pip" \
 && rm -rf /var/lib/apt/lists/*
# Ubuntu's Python takes packages from pip only by this word. numpy is left as apt has it, because
# rclpy was built against it.
ENV PIP_BREAK_SYSTEM_PACKAGES=1 PIP_NO_CACHE_DIR=1
COPY requirements/robot.txt /tmp/mtpgo_ros/robot.txt
RUN pip install --index-url https://download.pytorch.org/whl/cpu "torch>=2.13,<3" \
 && pip install -r /tmp/mtpgo_ros/robot.txt
WORKDIR /ws
COPY . src/mtpgo_ros
RUN . /opt/ros/jazzy/setup.sh \
 && colcon build --packages-select mtpgo_ros \
 && rm -rf build log
COPY docker/entrypoint.sh /entrypoint.sh
# Ubuntu 24.04 has a user `ubuntu` with this number.
USER 1000
ENV HOME=/tmp
WORKDIR /tmp
ENTRYPOINT ["/entrypoint.sh"]
# `ros2 launch` as process 1 obeys SIGINT only, and `ros2 run` no signal at all: the node itself.
STOPSIGNAL SIGINT
CMD ["/ws/install/mtpgo_ros/lib/mtpgo_ros/predictor"]

FROM python:3.12-slim AS slim
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
# PyTorch's own tests and its headers, 125 MB, are not needed to run a model.
RUN pip install --index-url https://download.pytorch.org/whl/cpu "torch>=2.13,<3" \
 && cd "$(python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')" \
 && rm -rf torch/test torch/include
WORKDIR /src
COPY . .
# hadolint ignore=DL3013
RUN pip install ".[ros]" \
 && rm -rf build mtpgo_ros.egg-info \
 && useradd --create-home --uid 1000 mtpgo
USER 1000
WORKDIR /home/mtpgo
CMD ["predictor"]

# For developers, also by .devcontainer/: `make` installs the rest into the checkout.
FROM python:3.12-slim AS development
# hadolint ignore=DL3008
RUN apt-get update \
 && apt-get install -y --no-install-recommends git make \
 && rm -rf /var/lib/apt/lists/* \
 && useradd --create-home --uid 1000 --shell /bin/bash mtpgo
USER 1000
WORKDIR /home/mtpgo
CMD ["bash"]
