// SPDX-License-Identifier: Apache-2.0
// What bad plugins do to runs of the program, and to runs that do not name them.
#include <csignal>

#include "diorama/abi.h"
#include "end_to_end/program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

Outcome run_with(const std::string& writer, const std::string& more = "") {
  const TemporaryFolder folder;
  fs::create_directory(folder / "plugins");
  fs::copy_file(DIORAMA_FAULTY_PLUGINS "/spoils_runs.so", folder / "plugins/spoils_runs.so");
  write_file(folder / "job.yaml",
             "seed: 1\n"
             "total_captures: 3\n"
             "environments: [{type: shapes, shapes: [cube]}]\n"
             "renderer: {type: 'null'}\n"
             "physics: {type: none}\n"
             "cameras: [{type: pinhole, name: cam, width: 32, height: 24}]\n"
             "timeline: [{capture: floating, count: 3}]\n"
             "writers: [{type: " +
                 writer + "}]\noutput: {folder: out}\n" + more);
  return run({"--plugin-dir", (folder / "plugins").string(), "run", "job.yaml"}, folder.path());
}

}  // namespace

TEST_CASE("an annotator that cannot be made breaks no job that does not need it", "[plugins]") {
  const Outcome outcome = run_with("wants_ids");
  INFO(outcome.errors);
  CHECK(outcome.exit_code == 0);
  CHECK(outcome.errors.find("licence") == std::string::npos);
  const Outcome needed = run_with("wants_edges");
  CHECK(needed.exit_code == 4);
  CHECK_THAT(needed.errors,
             ContainsSubstring("annotator 'edges': unexpected error: no licence for edges"));
}

TEST_CASE("an annotator of another plugin does not take over what the program makes", "[plugins]") {
  // "a_first" would give pictures of a wrong size, as it does where the job names it.
  CHECK(run_with("wants_ids").exit_code == 0);
  const Outcome named = run_with("wants_ids", "annotators: [{type: a_first}]\n");
  CHECK(named.exit_code == 1);
  CHECK_THAT(
      named.errors,
      ContainsSubstring("annotator 'a_first': /Cameras/cam_0: channel 'instance_id' has 3 x 3 "
                        "pixels, expected 32 x 24"));
}

TEST_CASE("an annotator that needs something else than its plugin lists is refused", "[plugins]") {
  const Outcome outcome = run_with("wants_heat");
  CHECK(outcome.exit_code == 4);
  CHECK_THAT(outcome.errors, ContainsSubstring("annotator 'heat': needs other names (color) than "
                                               "its plugin lists (); mend its"));
}

TEST_CASE("exit(0) in a plugin ends a run with an error", "[plugins]") {
  const Outcome outcome = run_with("leaves");
  INFO(outcome.errors);
  CHECK(outcome.exit_code == 4);
  CHECK_THAT(outcome.errors,
             ContainsSubstring("error: writer 'leaves' at capture 1 ended the program with exit(), "
                               "which components must not\n"));
}

#if !DIORAMA_DETAIL_ADDRESS_SANITIZER && !DIORAMA_DETAIL_THREAD_SANITIZER
TEST_CASE("nor does any other way to end the process pass for success", "[plugins]") {
  const auto [writer, call] =
      GENERATE(std::pair("leaves_quickly", "quick_exit()"), std::pair("leaves_at_once", "_exit()"),
               std::pair("leaves_at_once_by_c", "_exit()"));
  const Outcome outcome = run_with(writer);
  INFO(outcome.errors);
  CHECK(outcome.exit_code == 4);
  CHECK_THAT(outcome.errors, ContainsSubstring("error: writer '" + std::string(writer) +
                                               "' at capture 1 ended the program with " + call +
                                               ", which components must not\n"));
}

TEST_CASE("a crash names component and capture and ends the program by its signal", "[plugins]") {
  const Outcome crash = run_with("crashes");
  INFO(crash.errors);
  CHECK(crash.exit_code == 128 + SIGSEGV);
  CHECK_THAT(crash.errors, ContainsSubstring("error: crash in writer 'crashes' at capture 1: "
                                             "segmentation fault (signal 11)\n"));
  const Outcome abort = run_with("aborts");
  CHECK(abort.exit_code == 128 + SIGABRT);
  CHECK_THAT(abort.errors,
             ContainsSubstring("error: crash in writer 'aborts' at capture 1: abort (signal 6)\n"));
  const Outcome overflow = run_with("digs");
  CHECK(overflow.exit_code == 128 + SIGSEGV);
  CHECK_THAT(overflow.errors, ContainsSubstring("error: crash in writer 'digs' at capture 1: "));
  const Outcome elsewhere = run_with("crashes_elsewhere");
  CHECK(elsewhere.exit_code == 128 + SIGSEGV);
  CHECK_THAT(elsewhere.errors, ContainsSubstring("error: crash in "));
}
#endif
