# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Data sets recorded from vehicles: nuScenes, Argoverse 2 and Waymo.

Their files are read directly: JSON, Arrow and protocol buffers. ``docs/design.md`` says why not by
their development kits. pyarrow, protobuf and google-crc32c come with the extra ``datasets``.
"""
