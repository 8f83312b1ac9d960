// SPDX-License-Identifier: Apache-2.0
#include <diorama/plugin.h>

#include "die_loader.h"
#include "number_on_top.h"
#include "table_loader.h"
#include "throw_dice.h"

DIORAMA_PLUGIN("dice", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD_LOADER(dice::DieLoader, "dice", "Makes dice of many kinds of plastic: die:7.",
                     "die: plain_die:");
  DIORAMA_ADD_LOADER(dice::TableLoader, "dice_tables",
                     "Makes tables with trays, paper, cloth and clutter: dice_table:7.",
                     "dice_table: plain_table:");
  DIORAMA_ADD(dice::ThrowDice, "throw_dice", "Throws things onto an area.");
  DIORAMA_ADD(dice::NumberOnTop, "number_on_top",
              "Labels things by the face on top; hides what leans.");
}
