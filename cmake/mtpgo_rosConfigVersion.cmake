# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
#
# Which requests find_package(mtpgo_ros VERSION) this version satisfies: those for the same or an
# earlier version with the same first number and, while that is 0, the same second one (Semantic
# Versioning). Of a range, the upper end may lie anywhere. The version is that of package.xml.

file(STRINGS "${CMAKE_CURRENT_LIST_DIR}/../package.xml" mtpgo_ros_version_line
  REGEX "<version>[0-9.]+</version>" LIMIT_COUNT 1)
string(REGEX REPLACE ".*<version>([0-9.]+)</version>.*" "\\1"
  PACKAGE_VERSION "${mtpgo_ros_version_line}")
unset(mtpgo_ros_version_line)

string(REGEX MATCH "^([0-9]+)\\.([0-9]+)" mtpgo_ros_numbers "${PACKAGE_VERSION}")
set(mtpgo_ros_major "${CMAKE_MATCH_1}")
set(mtpgo_ros_minor "${CMAKE_MATCH_2}")

set(PACKAGE_VERSION_COMPATIBLE FALSE)
set(PACKAGE_VERSION_EXACT FALSE)
if(PACKAGE_FIND_VERSION_RANGE)
  if(PACKAGE_VERSION VERSION_GREATER_EQUAL PACKAGE_FIND_VERSION_MIN
      AND (PACKAGE_VERSION VERSION_LESS PACKAGE_FIND_VERSION_MAX
        OR (PACKAGE_FIND_VERSION_RANGE_MAX STREQUAL "INCLUDE"
          AND PACKAGE_VERSION VERSION_EQUAL PACKAGE_FIND_VERSION_MAX)))
    set(PACKAGE_VERSION_COMPATIBLE TRUE)
  endif()
elseif(PACKAGE_VERSION VERSION_GREATER_EQUAL PACKAGE_FIND_VERSION
    AND PACKAGE_FIND_VERSION_MAJOR EQUAL mtpgo_ros_major
    AND (mtpgo_ros_major GREATER 0
      OR PACKAGE_FIND_VERSION_COUNT EQUAL 1
      OR PACKAGE_FIND_VERSION_MINOR EQUAL mtpgo_ros_minor))
  set(PACKAGE_VERSION_COMPATIBLE TRUE)
  if(PACKAGE_VERSION VERSION_EQUAL PACKAGE_FIND_VERSION)
    set(PACKAGE_VERSION_EXACT TRUE)
  endif()
endif()
unset(mtpgo_ros_numbers)
unset(mtpgo_ros_major)
unset(mtpgo_ros_minor)
