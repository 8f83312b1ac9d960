#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Prints the commands of a Markdown page that a reader runs from top to bottom: those in the blocks
# below a line <!-- run these -->.
#   packaging/page_commands.sh PAGE
set -eu
sed -n '/^<!-- run these -->$/,/^```$/{/^<!-- run these -->$/d;/^```/d;p;}' "${1:?usage: page_commands.sh PAGE}"
