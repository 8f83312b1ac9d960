// SPDX-License-Identifier: Apache-2.0
#include <diorama/plugin.h>

void nothing_defines_this();

DIORAMA_PLUGIN("undefined_plugin", "1.0.0", "MIT") { nothing_defines_this(); }
