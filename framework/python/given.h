// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

namespace diorama {

/// What annotators and readers in Python give back, for the plugin `python`:
/// frame_copy(capsule "diorama::Frame", needs), set_channels(capsule "diorama::Frame", channels)
/// and store_capture(capsule "diorama::StoredCapture", capture).
void bind_given(pybind11::module_& module);

}  // namespace diorama
