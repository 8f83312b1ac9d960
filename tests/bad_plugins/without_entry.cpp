// SPDX-License-Identifier: Apache-2.0
#include "test_writer.h"

__attribute__((section(".diorama_plugin"), used)) static const DioramaPluginDescriptor descriptor{
    "DIORAMA",
    sizeof(DioramaPluginDescriptor),
    DIORAMA_SDK_ABI,
    diorama::abi::kLayout,
    DIORAMA_HEADERS_DIGEST,
    DIORAMA_ABI_TAG,
    "without_entry",
    "1.0.0",
    "MIT",
    "g++"};
