# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Cross-validation over sites: train without a site, test on it, for one site after the other."""
