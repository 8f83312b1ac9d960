// SPDX-License-Identifier: Apache-2.0
#include "test_writer.h"

// Listed under one name, registered under another.
__attribute__((section(".diorama_components"), used)) static const DioramaComponentEntry entry{
    std::uint32_t(diorama::ComponentKind::Writer), 0, "promised", "Is not there.", "", "", ""};

DIORAMA_PLUGIN("lists_other_components", "1.0.0", "MIT") {
  diorama::add<diorama::test::QuietWriter>(registrar, "delivered", "Is not listed.");
}
