# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Data sets recorded from vehicles: nuScenes, Argoverse 2 and Waymo.

Their files are read directly: JSON, Arrow and protocol buffers. ``docs/design.md`` says why not by
their development kits. pyarrow and protobuf come with the extra ``datasets``.
"""
