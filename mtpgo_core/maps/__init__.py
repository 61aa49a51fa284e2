# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines from map files: Lanelet2 OSM and GeoJSON."""
