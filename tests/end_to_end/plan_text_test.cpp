// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>

#include "program.h"
#include "support/catch.h"

using namespace diorama::test;

namespace {

/// An assets root with the names that the tutorial's jobs use; a dry run opens none of them.
void make_assets_root(const fs::path& root) {
  for (int room = 1; room <= 3; ++room) {
    write_file(root / "Isaac/Samples/Replicator/Infinigen/dining_rooms" /
                   ("dining_room_" + std::to_string(room)) / "export_scene.usdc",
               "");
  }
  for (const char* name :
       {"002_master_chef_can", "011_banana", "024_bowl", "036_wood_block", "008_pudding_box"}) {
    write_file(root / "Isaac/Props/YCB/Axis_Aligned" / (std::string(name) + ".usd"), "");
  }
  write_file(root / "Isaac/Props/YCB/Axis_Aligned/Materials/skipped.usd", "");
  write_file(root / "Isaac/Props/YCB/Axis_Aligned_Physics/006_mustard_bottle.usd", "");
  for (const char* name :
       {"SM_CardBoxD_04_1847", "SM_CardBoxA_01_414", "S_TrafficCone", "S_WetFloorSign"}) {
    write_file(root / "Isaac/Environments/Simple_Warehouse/Props" / (std::string(name) + ".usd"),
               "");
  }
  write_file(root / "Isaac/Environments/Office/Props/SM_Vase_01.usd", "");
  for (const char* name : {"SM_MedicalBag_01a", "SM_MedicalBox_01g"}) {
    write_file(root / "Isaac/Environments/Hospital/Props" / (std::string(name) + ".usd"), "");
  }
  for (const char* name :
       {"Cloudy/champagne_castle_1", "Cloudy/kloofendal_48d_partly_cloudy", "Clear/evening_road_01",
        "Clear/mealie_road", "Clear/qwantani", "Clear/noon_grass", "Evening/evening_road_01",
        "Night/kloppenheim_02", "Night/moonlit_golf"}) {
    write_file(root / "NVIDIA/Assets/Skies" / (std::string(name) + "_4k.hdr"), "");
  }
}

/// What the object-based example has beyond the tutorial's jobs, which would find it in folders.
void add_object_based_assets(const fs::path& root) {
  write_file(root / "Isaac/Environments/Simple_Warehouse/Props/SM_BarelPlastic_B_03.usd", "");
  for (const char* name :
       {"Board", "Book_03", "Book_34", "BookOpen_01", "Briefcase", "Extinguisher"}) {
    write_file(root / "Isaac/Environments/Office/Props" / ("SM_" + std::string(name) + ".usd"), "");
  }
  for (const char* name : {"SM_GasCart_01b", "SM_Toweldispenser_01a"}) {
    write_file(root / "Isaac/Environments/Hospital/Props" / (std::string(name) + ".usd"), "");
  }
  for (const char* name : {"autoshop_01", "carpentry_shop_01", "hotel_room", "wooden_lounge"}) {
    write_file(root / "NVIDIA/Assets/Skies/Indoor" / (std::string(name) + "_4k.hdr"), "");
  }
}

std::string dry_run(const std::vector<std::string>& job, bool is_object_based = false) {
  const TemporaryFolder folder;
  make_assets_root(folder / "root");
  if (is_object_based) add_object_based_assets(folder / "root");
  std::vector<std::string> arguments{"--assets-root", (folder / "root").string(), "run", "--plan"};
  arguments.insert(arguments.end(), job.begin(), job.end());
  const Outcome outcome = run(arguments, folder.path());
  INFO(outcome.errors);
  REQUIRE(outcome.exit_code == 0);
  fs::remove_all(folder / "root");
  CHECK(tree(folder.path()).empty());
  return outcome.output;
}

/// Compares with a stored text; DIORAMA_UPDATE_GOLDEN=1 stores it anew.
void check_golden(const std::string& name, const std::string& text) {
  const fs::path file = fs::path(DIORAMA_SOURCE_DIR "/tests/end_to_end/golden") / name;
  if (std::getenv("DIORAMA_UPDATE_GOLDEN")) write_file(file, text);
  CHECK(read_file(file) == text);
}

}  // namespace

TEST_CASE("The plan of the tutorial's defaults is what the tutorial prescribes", "[plan]") {
  const std::string text = dry_run({});
  CHECK_THAT(text, ContainsSubstring("9 captures x 2 cameras = 18 frames, seed 12, debug"));
  CHECK_THAT(
      text,
      ContainsSubstring(
          "timeline: simulate 4 -> capture floating x 2 -> simulate until rest, 200 to 800 -> "
          "capture dropped x 2"));
  CHECK_THAT(text, ContainsSubstring("environments (3)"));
  // 9 captures, 4 per visit: the third visit is cut short.
  CHECK_THAT(text, ContainsSubstring("capture 8: floating 1"));
  CHECK_THAT(text, ContainsSubstring("objects (38)"));
  CHECK_THAT(text, ContainsSubstring("auto_label: 6 below /Assets"));
  CHECK_THAT(text, ContainsSubstring("manual_label: 2 below /Assets"));
  CHECK_THAT(text, ContainsSubstring("manual_label_2: 2 below /Assets"));
  CHECK_THAT(text, ContainsSubstring("shape_distractors: 20 below"));
  CHECK_THAT(text, ContainsSubstring("mesh_distractors: 8 below"));
  CHECK_THAT(text, ContainsSubstring("cam x 2: pinhole 720x480") &&
                       ContainsSubstring("sees 0.25 to 1000 m"));
  CHECK_THAT(text, ContainsSubstring("SphereLight_scene x 3: sphere"));
  CHECK_THAT(text, ContainsSubstring("\"polar_angle_deg\": [0, 75]") &&
                       ContainsSubstring("\"polar_angle_deg\": [0, 45]"));
  CHECK_THAT(text, ContainsSubstring("\"distance\": [1.15, 1.45]"));
  CHECK_THAT(text, !ContainsSubstring("skipped"));
  check_golden("infinigen_default.txt", text);
  // The file is the built-in job.
  CHECK(dry_run({config_file("infinigen_default.yaml")}) == text);
  CHECK(dry_run({"--config", config_file("infinigen_default.yaml"), "--close-on-completion"}) ==
        text);
}

TEST_CASE("The plan of the tutorial's multi-writer job is what the tutorial prescribes", "[plan]") {
  const std::string text = dry_run({config_file("infinigen_multi_writers_pt.yaml")});
  CHECK_THAT(text, ContainsSubstring("12 captures x 2 cameras = 24 frames, seed 12, debug"));
  CHECK_THAT(text,
             ContainsSubstring(
                 "capture floating x 2 -> simulate until rest, 200 to 800 -> capture dropped x 3"));
  CHECK_THAT(text, ContainsSubstring("objects (49)"));
  CHECK_THAT(text, ContainsSubstring("auto_label: 5 below /Assets"));
  CHECK_THAT(text, ContainsSubstring("shape_distractors: 30 below"));
  CHECK_THAT(text, ContainsSubstring("mesh_distractors: 10 below"));
  CHECK_THAT(text, ContainsSubstring("cam x 2: pinhole 640x480"));
  CHECK_THAT(text, ContainsSubstring("SphereLight_scene x 4: sphere"));
  CHECK_THAT(text, ContainsSubstring("BasicWriter (BasicWriter) to _out_infinigen_basicwriter_pt"));
  CHECK_THAT(text, ContainsSubstring("to _out_infinigen_dataviswriter_pt"));
  CHECK_THAT(text, ContainsSubstring("\"mode\": \"path_traced\""));
  check_golden("infinigen_multi_writers_pt.txt", text);
}

TEST_CASE("The plans of the object-based jobs are what the example prescribes", "[plan]") {
  const std::string basic = dry_run({config_file("object_based_sdg_config.yaml")}, true);
  CHECK_THAT(basic, ContainsSubstring("10 captures x 2 cameras = 20 frames, seed 42"));
  CHECK_THAT(basic, ContainsSubstring("timeline: simulate 1, each step bounce -> 10 x (every 3: "
                                      "event cameras -> every 3: simulate 4, pushed by cameras, "
                                      "each step bounce -> capture frame x 1 -> every 5: simulate "
                                      "2, each step bounce -> simulate 1, each step bounce)"));
  CHECK_THAT(basic, ContainsSubstring("objects (447)"));
  CHECK_THAT(basic, ContainsSubstring("banana: 10 below /Assets/banana, 0 floating"));
  CHECK_THAT(basic, ContainsSubstring("mustard_bottle: 7 below /Assets/mustard_bottle, 7 "));
  CHECK_THAT(basic, ContainsSubstring("shape_distractors: 350 below"));
  CHECK_THAT(basic, ContainsSubstring("mesh_distractors: 75 below"));
  CHECK_THAT(basic,
             ContainsSubstring("BasicWriter (BasicWriter) to _out_obj_based_sdg_basic_writer"));
  check_golden("object_based_sdg_config.txt", basic);

  const std::string dope = dry_run({config_file("object_based_sdg_dope_config.yaml")}, true);
  CHECK_THAT(dope, ContainsSubstring("4 captures x 2 cameras = 8 frames, seed 42"));
  CHECK_THAT(dope, ContainsSubstring("to _out_obj_based_sdg_pose_writer_dope"));
  CHECK_THAT(dope, ContainsSubstring("\"format\": \"dope\""));
  check_golden("object_based_sdg_dope_config.txt", dope);
  // The other differs in its writer alone.
  std::string other = dry_run({config_file("object_based_sdg_centerpose_config.yaml")}, true);
  for (std::size_t place; (place = other.find("centerpose")) != other.npos;) {
    other.replace(place, 10, "dope");
  }
  CHECK(other == dope);
}
