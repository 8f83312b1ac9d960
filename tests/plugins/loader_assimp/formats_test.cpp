// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <string>

#include "loader_assimp/file_space.h"
#include "plugins/loader_assimp/loaded_file.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_assimp {

using test::LoadedFile;
using test::TemporaryFolder;

namespace {

/// A COLLADA file with one triangle of 200 x 300 units in the plane of its first two axes, a lamp
/// and a camera.
std::string collada(const std::string& unit, const std::string& up_axis) {
  return R"(<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="u" meter=")" +
         unit + R"("/><up_axis>)" + up_axis + R"(</up_axis></asset>
<library_cameras><camera id="cam"><optics><technique_common><perspective>
<xfov>60</xfov><aspect_ratio>2</aspect_ratio><znear>10</znear><zfar>1000</zfar>
</perspective></technique_common></optics></camera></library_cameras>
<library_lights><light id="lamp"><technique_common><point><color>2 1 0.5</color></point>
</technique_common></light></library_lights>
<library_effects><effect id="fx"><profile_COMMON><technique sid="common"><phong>
<diffuse><color>0.25 0.5 0.75 1</color></diffuse><specular><color>0.5 0.5 0.5 1</color></specular>
<shininess><float>30</float></shininess></phong></technique></profile_COMMON></effect>
</library_effects>
<library_materials><material id="mat" name="Paint"><instance_effect url="#fx"/></material>
</library_materials>
<library_geometries><geometry id="tri" name="tri"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 200 0 0 0 300 0</float_array>
<technique_common><accessor source="#pa" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1" material="m"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="Part" name="Part">
<translate>100 0 0</translate><instance_geometry url="#tri"><bind_material><technique_common>
<instance_material symbol="m" target="#mat"/></technique_common></bind_material>
</instance_geometry></node>
<node id="Lamp" name="Lamp"><translate>0 50 0</translate><instance_light url="#lamp"/></node>
<node id="Eye" name="Eye"><translate>0 0 400</translate><instance_camera url="#cam"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
)";
}

/// An ASCII FBX with one triangle (0,0,0) (2,0,0) (0,0,3), moved by (1, 0, 0).
std::string fbx(const std::string& global_settings) {
  return R"(; FBX 7.4.0 project file
FBXHeaderExtension:  {
	FBXHeaderVersion: 1003
	FBXVersion: 7400
}
GlobalSettings:  {
	Version: 1000
	Properties70:  {
)" + global_settings +
         R"(	}
}
Objects:  {
	Geometry: 10, "Geometry::Tri", "Mesh" {
		Vertices: *9 {
			a: 0,0,0,2,0,0,0,0,3
		}
		PolygonVertexIndex: *3 {
			a: 0,1,-3
		}
		GeometryVersion: 124
	}
	Model: 20, "Model::Part", "Mesh" {
		Version: 232
		Properties70:  {
			P: "Lcl Translation", "Lcl Translation", "", "A",1,0,0
		}
		Shading: T
		Culling: "CullingOff"
	}
}
Connections:  {
	C: "OO",20,0
	C: "OO",10,20
}
)";
}

std::string fbx_int(const std::string& name, int value) {
  return "\t\tP: \"" + name + "\", \"int\", \"Integer\", \"\"," + std::to_string(value) + "\n";
}

std::string fbx_double(const std::string& name, double value) {
  return "\t\tP: \"" + name + "\", \"double\", \"Number\", \"\"," + std::to_string(value) + "\n";
}

std::string fbx_axes(int up, int up_sign, int front, int front_sign) {
  return fbx_int("UpAxis", up) + fbx_int("UpAxisSign", up_sign) + fbx_int("FrontAxis", front) +
         fbx_int("FrontAxisSign", front_sign) + fbx_int("CoordAxis", 0) +
         fbx_int("CoordAxisSign", 1);
}

void check_box(const Aabb& box, const Vec3& min, const Vec3& max) {
  INFO(box.min.transpose() << " to " << box.max.transpose());
  CHECK((box.min - min).norm() < 1e-5);
  CHECK((box.max - max).norm() < 1e-5);
}

}  // namespace

TEST_CASE("OBJ is taken as it stands; parameters say otherwise", "[loader_assimp]") {
  const TemporaryFolder folder;
  const std::string file = folder.write("a.obj", "o Part\nv 1 2 3\nv 5 2 3\nv 1 4 6\nf 1 2 3\n");
  check_box(LoadedFile(file).bounds(), {1, 2, 3}, {5, 4, 6});
  AssimpLoader::Params y_up;
  y_up.unstated.up_axis = "y";
  y_up.unstated.meters_per_unit = 0.01;
  // (x, y, z) with y up is (x, -z, y) with z up.
  check_box(LoadedFile(file, y_up).bounds(), {0.01, -0.06, 0.02}, {0.05, -0.03, 0.04});
  AssimpLoader::Params x_up;
  x_up.unstated.up_axis = "x";
  check_box(LoadedFile(file, x_up).bounds(), {-6, 2, 1}, {-3, 4, 5});
}

TEST_CASE("MTL becomes materials: one mesh per object, one slot per material", "[loader_assimp]") {
  const TemporaryFolder folder;
  folder.write("pictures/wood.png", test::red_green_png());
  folder.write("a.mtl",
               "newmtl Wood\nKd 0.6 0.6 0.6\nKs 0.5 0.5 0.5\nNs 30\nmap_Kd pictures/wood.png \n"
               "newmtl Glass\nKd 0.1 0.2 0.3\nKs 0 0 0\nd 0.25\nKe 1 2 3\n");
  const std::string file =
      folder.write("a.obj",
                   "mtllib a.mtl\no Part\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\n"
                   "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl Wood\nf 1/1 2/2 3/3 4/4\n"
                   "usemtl Glass\nf 1/1 2/2 5/4\n");
  const LoadedFile loaded(file);
  CHECK(loaded.host.messages.empty());
  const Node& part = loaded.node("Part");
  REQUIRE(part.mesh);
  CHECK(part.mesh->triangles.size() == 3);
  CHECK(part.mesh->material_slots == std::vector<std::uint16_t>{0, 0, 1});
  CHECK(part.mesh->uvs.at(0) == Vec2f(0, 0));
  REQUIRE(part.materials.size() == 2);
  const Material& wood = *part.materials[0];
  CHECK(wood.name == "Wood");
  REQUIRE(wood.base_color_texture);
  CHECK(wood.base_color == Vec3f::Ones());
  CHECK(wood.base_color_texture.texture->width == 2);
  CHECK(wood.base_color_texture.texture->color_space == ColorSpace::Srgb);
  CHECK(wood.specular == Approx(1.0f));
  CHECK(wood.roughness == Approx(std::pow(2.0 / 32.0, 0.25)).epsilon(1e-4));
  const Material& glass = *part.materials[1];
  CHECK(glass.base_color.isApprox(Vec3f(0.1f, 0.2f, 0.3f)));
  CHECK(glass.specular == 0.0f);
  CHECK(glass.transmission == Approx(0.75f));
  CHECK(glass.is_thin_walled);
  CHECK(glass.emission.isApprox(Vec3f(1, 2, 3)));
}

TEST_CASE("flat and rounded OBJ surfaces without normals get fitting ones", "[loader_assimp]") {
  const TemporaryFolder folder;
  // Two faces that meet at 90 degrees, and two at about 11 degrees.
  const auto normals = [&](const char* name, const char* fifth) {
    const LoadedFile loaded(
        folder.write(name, std::string("o Part\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n") + fifth +
                               "f 1 2 3 4\nf 2 5 3\n"));
    return loaded.node("Part").mesh->normals;
  };
  for (const Vec3f& normal : normals("sharp.obj", "v 1 0 -1\n")) {
    CHECK((normal.isApprox(Vec3f::UnitZ(), 1e-5f) || normal.isApprox(Vec3f::UnitX(), 1e-5f)));
  }
  int tilted = 0;
  for (const Vec3f& normal : normals("soft.obj", "v 2 0 -0.2\n")) {
    tilted += normal.x() > 0.05f && normal.x() < 0.15f ? 1 : 0;
  }
  CHECK(tilted >= 2);
}

TEST_CASE("STL and PLY arrive in metres, PLY with its colours", "[loader_assimp]") {
  const TemporaryFolder folder;
  const LoadedFile stl(folder.write(
      "a.stl",
      "solid part\nfacet normal 0 0 1\nouter loop\nvertex 0 0 2\nvertex 1 0 2\nvertex 0 1 2\n"
      "endloop\nendfacet\nendsolid part\n"));
  check_box(stl.bounds(), {0, 0, 2}, {1, 1, 2});

  const LoadedFile ply(folder.write(
      "a.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0 0 0 255 0 128\n1 0 0 255 0 128\n0 1 0 255 0 128\n3 0 1 2\n"));
  check_box(ply.bounds(), {0, 0, 0}, {1, 1, 0});
  const auto nodes = ply.scene.subtree(ply.root);
  const Node& node = ply.scene[nodes.back()];
  REQUIRE(node.mesh);
  REQUIRE(node.mesh->colors.size() == 3);
  // 128 of 255, sRGB, is 0.2159 of the light.
  CHECK(node.mesh->colors[0].isApprox(Vec3f(1.0f, 0.0f, 0.2159f), 1e-3f));
  CHECK(node.materials.at(0)->base_color.isApprox(Vec3f::Ones()));
}

TEST_CASE("COLLADA is scaled by its unit and turned by its axis", "[loader_assimp]") {
  const TemporaryFolder folder;
  const LoadedFile y_up(folder.write("y.dae", collada("0.01", "Y_UP")));
  check_box(y_up.bounds(), {1, 0, 0}, {3, 0, 3});
  const LoadedFile z_up(folder.write("z.dae", collada("1", "Z_UP")));
  check_box(z_up.bounds(), {100, 0, 0}, {300, 300, 0});
  const LoadedFile inches(folder.write("i.dae", collada("0.0254", "Z_UP")));
  check_box(inches.bounds(), {2.54, 0, 0}, {7.62, 7.62, 0});

  const Material& paint = *y_up.node("Part").materials.at(0);
  CHECK(paint.name == "Paint");
  CHECK(paint.base_color.isApprox(Vec3f(0.25f, 0.5f, 0.75f)));
  CHECK(paint.specular == Approx(1.0f));
}

TEST_CASE("lights and cameras of COLLADA have sizes in metres", "[loader_assimp]") {
  const TemporaryFolder folder;
  const LoadedFile loaded(folder.write("a.dae", collada("0.01", "Y_UP")));
  const Affine lamp = loaded.scene.world_from_node(loaded.id("Lamp"));
  CHECK(lamp.translation().isApprox(Vec3(0, 0, 0.5), 1e-6));
  CHECK(lamp.linear().determinant() == Approx(1.0));
  const Light& light = *loaded.node("Lamp").light;
  CHECK(light.kind == LightKind::Sphere);
  // The sphere's disc shines as strongly as the point: 2 W/sr of red.
  CHECK(light.color.x() * kPi * light.radius_m * light.radius_m == Approx(2.0));

  const Affine eye = loaded.scene.world_from_node(loaded.id("Eye"));
  CHECK(eye.translation().isApprox(Vec3(0, -4, 0), 1e-6));
  CHECK((eye.linear() * -Vec3::UnitZ()).isApprox(Vec3::UnitY(), 1e-6));
  CHECK((eye.linear() * Vec3::UnitY()).isApprox(Vec3::UnitZ(), 1e-6));
  // Whether its angle of 60 degrees arrives depends on the version of assimp.
  const Camera& camera = *loaded.node("Eye").camera;
  const double angle = 2.0 * std::atan(0.5 * camera.width / camera.fx);
  CHECK((angle == Approx(kPi / 3).epsilon(1e-4) || angle == Approx(kPi / 4).epsilon(1e-4)));
}

TEST_CASE("FBX is scaled by its unit and turned by its axes", "[loader_assimp]") {
  const TemporaryFolder folder;
  // Centimetres and y up, as Maya writes them.
  const LoadedFile maya(
      folder.write("maya.fbx", fbx(fbx_axes(1, 1, 2, 1) + fbx_double("UnitScaleFactor", 1.0))));
  check_box(maya.bounds(), {0.01, -0.03, 0}, {0.03, 0, 0});
  // Inches and z up, as 3ds Max does.
  const LoadedFile max(
      folder.write("max.fbx", fbx(fbx_axes(2, 1, 1, -1) + fbx_double("UnitScaleFactor", 2.54))));
  check_box(max.bounds(), {0.0254, 0, 0}, {0.0762, 0, 0.0762});
  // Metres, with -y up.
  const LoadedFile odd(
      folder.write("odd.fbx", fbx(fbx_axes(1, -1, 2, -1) + fbx_double("UnitScaleFactor", 100.0))));
  check_box(odd.bounds(), {1, 0, 0}, {3, 3, 0});
  // Axes that are none: y up.
  const LoadedFile bad(
      folder.write("bad.fbx", fbx(fbx_axes(0, 1, 0, 1) + fbx_double("UnitScaleFactor", 100.0))));
  check_box(bad.bounds(), {1, -3, 0}, {3, 0, 0});
}

TEST_CASE("units and axes can be told", "[loader_assimp]") {
  const TemporaryFolder folder;
  test::RenderHost host{1};
  const auto told = [&](const std::string& name, const std::string& text) {
    return describe_units(SceneFile({folder.write(name, text), {}, {}}, host), {});
  };
  CHECK(told("a.fbx", fbx(fbx_axes(2, 1, 1, -1) + fbx_double("UnitScaleFactor", 2.54))) ==
        "units: 0.0254 m, z up");
  CHECK(told("b.fbx", fbx(fbx_axes(1, -1, 2, -1) + fbx_double("UnitScaleFactor", 100.0))) ==
        "units: 1 m, -y up");
  CHECK(told("c.dae", collada("0.01", "Y_UP")) == "units: 0.01 m, y up");
  CHECK(told("d.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n") == "units: 1 m, z up");
}

}  // namespace diorama::loader_assimp
