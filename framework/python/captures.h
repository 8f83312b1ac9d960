// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/reader.h"

/// Captures as dictionaries and views of pixels, of which diorama/__init__.py makes its classes.
/// With the interpreter's lock held, except where said otherwise.
namespace diorama {

/// By LensModel.
inline constexpr const char* kLensNames[]{"pinhole", "opencv_pinhole", "fisheye_polynomial"};

/// Files may say what is no UTF-8, and be called so: such bytes stay what they are, as in
/// os.fsdecode().
pybind11::str text_of(std::string_view text);
pybind11::list texts_of(const std::vector<std::string>& texts);

pybind11::list findings_of(const ReadLog& log);

/// `holds` says what is None; arrays keep `stored` alive.
pybind11::dict capture_of(std::shared_ptr<const StoredCapture> stored, const NameSet& holds);

/// A run's own frames end when they are written: a copy with the channels in `needs`. Without the
/// lock.
std::shared_ptr<const StoredCapture> copy_of(const Capture& capture, const NameSet& needs);

/// What capture_of() may take from captures that were made, not read.
NameSet made_holds();

/// What the plugin `python` hands to writers: capture_copy(capsule, needs), files_of(capsule),
/// capture_files_of(capsule), dataset_of(capsule).
void bind_captures(pybind11::module_& module);

}  // namespace diorama
