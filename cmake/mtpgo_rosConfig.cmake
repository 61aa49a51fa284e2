# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
#
# find_package(mtpgo_ros) for the C++ headers of this package, which is a Python package otherwise.
# The target mtpgo_ros::predictions has the include folder; it is header-only. predictions_msg.hpp
# needs sensor_msgs as well: find_package(sensor_msgs) and link ${sensor_msgs_TARGETS}.

get_filename_component(mtpgo_ros_PREFIX "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
set(mtpgo_ros_INCLUDE_DIRS "${mtpgo_ros_PREFIX}/include/mtpgo_ros")
if(NOT EXISTS "${mtpgo_ros_INCLUDE_DIRS}/mtpgo_ros/predictions.hpp")
  set(mtpgo_ros_FOUND FALSE)
  set(mtpgo_ros_NOT_FOUND_MESSAGE "${mtpgo_ros_INCLUDE_DIRS} lacks mtpgo_ros/predictions.hpp")
  return()
endif()

if(NOT TARGET mtpgo_ros::predictions)
  add_library(mtpgo_ros::predictions INTERFACE IMPORTED)
  set_target_properties(mtpgo_ros::predictions PROPERTIES
    INTERFACE_INCLUDE_DIRECTORIES "${mtpgo_ros_INCLUDE_DIRS}"
    INTERFACE_COMPILE_FEATURES cxx_std_17)
endif()
set(mtpgo_ros_TARGETS mtpgo_ros::predictions)
