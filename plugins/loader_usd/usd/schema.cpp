// SPDX-License-Identifier: Apache-2.0
#include "schema.h"

#include <algorithm>
#include <array>

namespace diorama::usd {
namespace {

enum Level { kTyped, kImageable, kXformable, kBoundable, kGprim, kPointBased };

struct TypeEntry {
  std::string_view name;
  Level level;
  bool is_light = false;
};

// The concrete prim types of OpenUSD 24.11 and the base that decides what they can do.
constexpr std::array kTypes = {
    TypeEntry{"Scope", kImageable},
    TypeEntry{"Xform", kXformable},
    TypeEntry{"Camera", kXformable},
    TypeEntry{"PointInstancer", kBoundable},
    TypeEntry{"GeomSubset", kTyped},
    TypeEntry{"Mesh", kPointBased},
    TypeEntry{"TetMesh", kPointBased},
    TypeEntry{"Points", kPointBased},
    TypeEntry{"BasisCurves", kPointBased},
    TypeEntry{"NurbsCurves", kPointBased},
    TypeEntry{"HermiteCurves", kPointBased},
    TypeEntry{"NurbsPatch", kPointBased},
    TypeEntry{"Cube", kGprim},
    TypeEntry{"Sphere", kGprim},
    TypeEntry{"Cylinder", kGprim},
    TypeEntry{"Cylinder_1", kGprim},
    TypeEntry{"Cone", kGprim},
    TypeEntry{"Capsule", kGprim},
    TypeEntry{"Capsule_1", kGprim},
    TypeEntry{"Plane", kGprim},
    TypeEntry{"Volume", kGprim},
    TypeEntry{"OpenVDBAsset", kXformable},
    TypeEntry{"Field3DAsset", kXformable},
    TypeEntry{"SphereLight", kBoundable, true},
    TypeEntry{"DiskLight", kBoundable, true},
    TypeEntry{"RectLight", kBoundable, true},
    TypeEntry{"CylinderLight", kBoundable, true},
    TypeEntry{"PortalLight", kBoundable, true},
    TypeEntry{"DistantLight", kXformable, true},
    TypeEntry{"DomeLight", kXformable, true},
    TypeEntry{"DomeLight_1", kXformable, true},
    TypeEntry{"GeometryLight", kXformable, true},
    TypeEntry{"PluginLight", kXformable, true},
    TypeEntry{"LightFilter", kXformable},
    TypeEntry{"PluginLightFilter", kXformable},
    TypeEntry{"SkelRoot", kBoundable},
    TypeEntry{"Skeleton", kBoundable},
    TypeEntry{"SkelAnimation", kTyped},
    TypeEntry{"BlendShape", kTyped},
    TypeEntry{"SpatialAudio", kXformable},
    TypeEntry{"GenerativeProcedural", kBoundable},
    TypeEntry{"PhysicsScene", kTyped},
    TypeEntry{"PhysicsCollisionGroup", kTyped},
    TypeEntry{"PhysicsJoint", kImageable},
    TypeEntry{"PhysicsRevoluteJoint", kImageable},
    TypeEntry{"PhysicsPrismaticJoint", kImageable},
    TypeEntry{"PhysicsSphericalJoint", kImageable},
    TypeEntry{"PhysicsDistanceJoint", kImageable},
    TypeEntry{"PhysicsFixedJoint", kImageable},
    TypeEntry{"Material", kTyped},
    TypeEntry{"NodeGraph", kTyped},
    TypeEntry{"Shader", kTyped},
    TypeEntry{"RenderSettings", kTyped},
    TypeEntry{"RenderProduct", kTyped},
    TypeEntry{"RenderVar", kTyped},
    TypeEntry{"RenderPass", kTyped},
    TypeEntry{"Backdrop", kTyped},
};

constexpr std::array<std::string_view, 29> kSingleSchemas = {"AssetPreviewsAPI",
                                                             "GeomModelAPI",
                                                             "HydraGenerativeProceduralAPI",
                                                             "LightAPI",
                                                             "LightListAPI",
                                                             "ListAPI",
                                                             "MaterialBindingAPI",
                                                             "MaterialXConfigAPI",
                                                             "MeshLightAPI",
                                                             "MotionAPI",
                                                             "NodeDefAPI",
                                                             "NodeGraphNodeAPI",
                                                             "PhysicsArticulationRootAPI",
                                                             "PhysicsCollisionAPI",
                                                             "PhysicsFilteredPairsAPI",
                                                             "PhysicsMassAPI",
                                                             "PhysicsMaterialAPI",
                                                             "PhysicsMeshCollisionAPI",
                                                             "PhysicsRigidBodyAPI",
                                                             "RiMaterialAPI",
                                                             "RiRenderPassAPI",
                                                             "RiSplineAPI",
                                                             "SceneGraphPrimAPI",
                                                             "ShadowAPI",
                                                             "ShapingAPI",
                                                             "SkelBindingAPI",
                                                             "StatementsAPI",
                                                             "VisibilityAPI",
                                                             "VolumeLightAPI"};

constexpr std::array<std::string_view, 5> kMultipleSchemas = {
    "CollectionAPI", "CoordSysAPI", "PhysicsDriveAPI", "PhysicsLimitAPI", "SemanticsLabelsAPI"};

Strings included_schemas(std::string_view name) {
  if (name == "MeshLightAPI" || name == "VolumeLightAPI") return {"LightAPI"};
  if (name == "LightAPI") return {"CollectionAPI:lightLink", "CollectionAPI:shadowLink"};
  return {};
}

Strings built_in_schemas(std::string_view type) {
  if (type == "Shader") return {"NodeDefAPI"};
  if (type == "PluginLight") return {"NodeDefAPI", "LightAPI"};
  if (type == "PluginLightFilter") return {"NodeDefAPI", "CollectionAPI:filterLink"};
  if (type == "LightFilter") return {"CollectionAPI:filterLink"};
  if (type == "PhysicsCollisionGroup") return {"CollectionAPI:colliders"};
  if (type_traits(type).is_light) return {"LightAPI"};
  return {};
}

bool is_defined_schema(std::string_view name) {
  const std::size_t colon = name.find(':');
  if (colon == std::string_view::npos) {
    return std::find(kSingleSchemas.begin(), kSingleSchemas.end(), name) != kSingleSchemas.end();
  }
  return std::find(kMultipleSchemas.begin(), kMultipleSchemas.end(), name.substr(0, colon)) !=
         kMultipleSchemas.end();
}

void add_schema(Strings& schemas, const std::string& name) {
  if (std::find(schemas.begin(), schemas.end(), name) != schemas.end()) return;
  if (!is_defined_schema(name)) return;
  schemas.push_back(name);
  for (const std::string& more : included_schemas(name)) add_schema(schemas, more);
}

}  // namespace

TypeTraits type_traits(std::string_view type_name) {
  const auto* found = std::find_if(kTypes.begin(), kTypes.end(),
                                   [&](const TypeEntry& type) { return type.name == type_name; });
  if (found == kTypes.end()) return {};
  TypeTraits traits;
  traits.is_known = true;
  traits.is_imageable = found->level >= kImageable;
  traits.is_xformable = found->level >= kXformable;
  traits.is_boundable = found->level >= kBoundable;
  traits.is_gprim = found->level >= kGprim;
  traits.is_point_based = found->level >= kPointBased;
  traits.is_light = found->is_light;
  return traits;
}

std::string_view schema_attribute_type(const TypeTraits& traits, std::string_view attribute) {
  if (!traits.is_gprim) return {};
  if (attribute == "primvars:displayColor") return "color3f[]";
  if (attribute == "primvars:displayOpacity") return "float[]";
  return {};
}

Strings api_schemas(std::string_view type_name, const Strings& applied) {
  Strings schemas;
  for (const std::string& name : built_in_schemas(type_name)) add_schema(schemas, name);
  for (const std::string& name : applied) add_schema(schemas, name);
  return schemas;
}

}  // namespace diorama::usd
