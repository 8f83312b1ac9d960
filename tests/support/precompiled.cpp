// SPDX-License-Identifier: Apache-2.0
// Exists for its precompiled header only.
int main() { return 0; }
