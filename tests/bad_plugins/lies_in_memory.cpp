// SPDX-License-Identifier: Apache-2.0
#include "test_writer.h"

// The file says one thing, the code another.
__attribute__((section(".diorama_plugin"), used)) static const DioramaPluginDescriptor in_file{
    "DIORAMA",
    sizeof(DioramaPluginDescriptor),
    DIORAMA_SDK_ABI,
    diorama::abi::kLayout,
    DIORAMA_HEADERS_DIGEST,
    DIORAMA_ABI_TAG,
    "harmless",
    "1.0.0",
    "MIT",
    "g++"};

static const DioramaPluginDescriptor in_memory{"DIORAMA",
                                               sizeof(DioramaPluginDescriptor),
                                               DIORAMA_SDK_ABI,
                                               diorama::abi::kLayout,
                                               DIORAMA_HEADERS_DIGEST,
                                               DIORAMA_ABI_TAG,
                                               "somebody_else",
                                               "1.0.0",
                                               "MIT",
                                               "g++"};

static void register_nothing(diorama::Registrar&) {}

extern "C" DIORAMA_SDK_API const DioramaPlugin* diorama_plugin() {
  static const DioramaPlugin plugin{&in_memory, &register_nothing};
  return &plugin;
}
