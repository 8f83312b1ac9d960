// SPDX-License-Identifier: Apache-2.0
#include "mesh_collision.h"

#include <BulletCollision/CollisionShapes/btTriangleShape.h>

#include <algorithm>
#include <array>
#include <bit>
#include <new>
#include <optional>

#include "diorama/math.h"

namespace diorama {
namespace {

/// Whether the triangle is farther from the shape than `reach`, as far as four axes tell: those of
/// the shape, and that from its middle to the triangle's. They leave out two triangles of three
/// that Bullet looks at (measured: things in plates and bowls); the triangle's normal none.
bool is_apart(const btCollisionObjectWrapper& convex, const btCollisionObjectWrapper& triangle,
              double reach) {
  const auto& shape = static_cast<const btConvexShape&>(*convex.getCollisionShape());
  const auto& corners = static_cast<const btTriangleShape&>(*triangle.getCollisionShape());
  btVector3 low;
  btVector3 high;
  shape.getAabb(btTransform::getIdentity(), low, high);
  const btTransform shape_from_triangle =
      convex.getWorldTransform().inverseTimes(triangle.getWorldTransform());
  std::array<btVector3, 3> p;
  for (int i = 0; i < 3; ++i) {
    p[std::size_t(i)] = shape_from_triangle * corners.getVertexPtr(i);
  }
  for (int axis = 0; axis < 3; ++axis) {
    const auto [least, most] = std::minmax({p[0][axis], p[1][axis], p[2][axis]});
    if (least > high[axis] + reach || most < low[axis] - reach) return true;
  }
  btVector3 way = (p[0] + p[1] + p[2]) / 3.0 - 0.5 * (low + high);
  const double length = way.length();
  if (!(length > 0.0)) return false;
  way /= length;
  const double least = std::min({way.dot(p[0]), way.dot(p[1]), way.dot(p[2])});
  return least - way.dot(shape.localGetSupportingVertex(way)) > reach;
}

/// Hands on what Bullet finds on one triangle.
class ContactsOfTriangle final : public btManifoldResult {
 public:
  ContactsOfTriangle(const btManifoldResult& of_mesh, const btCollisionObjectWrapper& triangle,
                     MeshContacts& contacts)
      : btManifoldResult(of_mesh), triangle_(triangle), contacts_(contacts) {}

  void addContactPoint(const btVector3& normal, const btVector3& place,
                       btScalar distance) override {
    // Nor what is no number.
    if (!(distance <= getPersistentManifold()->getContactBreakingThreshold())) return;
    contacts_.add({normal, place, distance, facing(normal), triangle_.m_partId, triangle_.m_index});
  }

 private:
  btScalar facing(const btVector3& normal) const {
    btVector3 across;
    static_cast<const btTriangleShape&>(*triangle_.getCollisionShape()).calcNormal(across);
    return btFabs((triangle_.getWorldTransform().getBasis() * across).dot(normal));
  }

  const btCollisionObjectWrapper& triangle_;
  MeshContacts& contacts_;
};

class TriangleAlgorithm final : public btConvexConvexAlgorithm {
 public:
  /// Where three contacts were found, hulls need not be turned to find more.
  TriangleAlgorithm(const btCollisionAlgorithmConstructionInfo& info,
                    const btCollisionObjectWrapper* convex,
                    const btCollisionObjectWrapper* triangle,
                    const btConvexConvexAlgorithm::CreateFunc& usual, MeshContacts& contacts)
      : btConvexConvexAlgorithm(info.m_manifold, info, convex, triangle, usual.m_pdSolver,
                                contacts.count() < kFace ? usual.m_numPerturbationIterations : 0,
                                usual.m_minimumPointsPerturbationThreshold),
        contacts_(contacts) {}

  void processCollision(const btCollisionObjectWrapper* convex,
                        const btCollisionObjectWrapper* triangle, const btDispatcherInfo& info,
                        btManifoldResult* result) override {
    const double reach = convex->getCollisionShape()->getMargin() +
                         triangle->getCollisionShape()->getMargin() +
                         result->getPersistentManifold()->getContactBreakingThreshold() +
                         result->m_closestPointDistanceThreshold;
    if (is_apart(*convex, *triangle, reach)) return;
    if (!contacts_.takes_next_triangle()) return;
    ContactsOfTriangle contacts(*result, *triangle, contacts_);
    btConvexConvexAlgorithm::processCollision(convex, triangle, info, &contacts);
  }

 private:
  static constexpr std::size_t kFace = 3;
  MeshContacts& contacts_;
};

class MeshAlgorithm final : public btConvexConcaveCollisionAlgorithm {
 public:
  MeshAlgorithm(const btCollisionAlgorithmConstructionInfo& info,
                const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                bool is_mesh_first, MeshContacts& contacts)
      : btConvexConcaveCollisionAlgorithm(info, first, second, is_mesh_first),
        is_mesh_first_(is_mesh_first),
        contacts_(contacts) {}

  void processCollision(const btCollisionObjectWrapper* first,
                        const btCollisionObjectWrapper* second, const btDispatcherInfo& info,
                        btManifoldResult* result) override {
    contacts_.begin();
    btConvexConcaveCollisionAlgorithm::processCollision(first, second, info, result);
    // The result's order is another where a compound's parts meet the mesh.
    const btCollisionObject* const mesh = (is_mesh_first_ ? first : second)->getCollisionObject();
    if (contacts_.count() > 0) contacts_.write(*result, result->getBody0Internal() == mesh);
  }

 private:
  bool is_mesh_first_;
  MeshContacts& contacts_;
};

/// A contact that a manifold may get.
struct Candidate {
  btVector3 place;  ///< World.
  btScalar distance;
  btScalar facing;     ///< 0 of what was kept.
  std::size_t number;  ///< Of those found, then of those kept.
};

/// Up to four: the first is one of the deepest, the farthest out of them, and each next one is far
/// from those before it. What touches comes before what is only near. A body stands on the corners
/// of what it touches, or it would rock. Of triangles that meet where a contact is, at an edge, it
/// is that one's that faces it most: contacts are judged by their triangles later on.
std::vector<Candidate> widest(const std::vector<Candidate>& candidates) {
  constexpr double kAsDeep = 5e-4;  // metres
  constexpr double kApart = 1e-3;   // metres
  double deepest = kInfinity;
  for (const Candidate& c : candidates) deepest = std::min(deepest, double(c.distance));
  const auto is_deepest = [&](const Candidate& c) { return c.distance <= deepest + kAsDeep; };
  btVector3 middle(0.0, 0.0, 0.0);
  int count = 0;
  for (const Candidate& c : candidates) {
    if (!is_deepest(c)) continue;
    middle += c.place;
    ++count;
  }
  middle /= count;
  // From the middle for the first, then from the closest of those chosen.
  std::vector<double> gaps;
  for (const Candidate& c : candidates) {
    gaps.push_back(is_deepest(c) ? kApart + double(c.place.distance(middle)) : 0.0);
  }
  const double touching = std::max(0.0, deepest + kAsDeep);
  const auto next = [&] {
    std::optional<std::size_t> best;
    bool best_touches = false;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (gaps[i] < kApart) continue;
      const bool touches = candidates[i].distance < touching;
      const bool is_better = !best || (touches != best_touches ? touches : gaps[i] > gaps[*best]);
      if (!is_better) continue;
      best = i;
      best_touches = touches;
    }
    return best;
  };
  const auto most_facing = [&](const Candidate& at) {
    Candidate most = at;
    for (const Candidate& c : candidates) {
      const bool is_there =
          double(c.place.distance(at.place)) < kApart && c.distance < at.distance + kAsDeep;
      if (is_there && c.facing > most.facing) most = c;
    }
    return most;
  };
  std::vector<Candidate> chosen;
  while (chosen.size() < MANIFOLD_CACHE_SIZE) {
    const std::optional<std::size_t> best = next();
    if (!best) break;
    if (chosen.empty()) std::fill(gaps.begin(), gaps.end(), kInfinity);
    chosen.push_back(most_facing(candidates[*best]));
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      gaps[i] = std::min(gaps[i], double(candidates[i].place.distance(chosen.back().place)));
    }
  }
  return chosen;
}

void remove_all(btPersistentManifold& manifold) {
  while (manifold.getNumContacts() > 0) manifold.removeContactPoint(manifold.getNumContacts() - 1);
}

/// The contact goes on as the closest one that was kept within `reach`, which is taken out.
void take_impulses(std::vector<btManifoldPoint>& kept, double reach, btManifoldPoint& contact) {
  const auto distance = [&](const btManifoldPoint& other) {
    return double(other.m_localPointA.distance(contact.m_localPointA));
  };
  const auto closest = std::ranges::min_element(kept, {}, distance);
  if (closest == kept.end() || distance(*closest) >= reach) return;
  contact.m_appliedImpulse = closest->m_appliedImpulse;
  contact.m_appliedImpulseLateral1 = closest->m_appliedImpulseLateral1;
  contact.m_appliedImpulseLateral2 = closest->m_appliedImpulseLateral2;
  contact.m_prevRHS = closest->m_prevRHS;
  contact.m_lifeTime = closest->m_lifeTime;
  kept.erase(closest);
}

}  // namespace

void MeshContacts::begin() {
  triangles_ = 0;
  found_.clear();
}

bool MeshContacts::takes_next_triangle() {
  constexpr std::uint32_t kOfEachStride = 64;
  const std::uint32_t number = triangles_++;
  return number % std::bit_floor(std::max(number / kOfEachStride, 1u)) == 0;
}

void MeshContacts::write(btManifoldResult& result, bool is_mesh_first) const {
  btPersistentManifold& manifold = *result.getPersistentManifold();
  const double reach = manifold.getContactBreakingThreshold();
  std::vector<btManifoldPoint> kept;
  for (int i = 0; i < manifold.getNumContacts(); ++i) kept.push_back(manifold.getContactPoint(i));
  std::vector<Candidate> candidates;
  for (const Contact& c : found_) {
    candidates.push_back({c.place, c.distance, c.facing, candidates.size()});
  }
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const bool is_found_again = std::ranges::any_of(found_, [&](const Contact& c) {
      return c.place.distance(kept[i].m_positionWorldOnB) < reach;
    });
    if (is_found_again) continue;
    candidates.push_back(
        {kept[i].m_positionWorldOnB, kept[i].getDistance(), 0.0, found_.size() + i});
  }
  // Bullet makes its contact of what was found; together they would take each other's places.
  const std::vector<btManifoldPoint> before = kept;
  std::vector<btManifoldPoint> written;
  remove_all(manifold);
  for (const Candidate& candidate : widest(candidates)) {
    if (candidate.number >= found_.size()) {
      written.push_back(before[candidate.number - found_.size()]);
      continue;
    }
    const Contact& contact = found_[candidate.number];
    if (is_mesh_first) {
      result.setShapeIdentifiersA(contact.part, contact.triangle);
    } else {
      result.setShapeIdentifiersB(contact.part, contact.triangle);
    }
    result.addContactPoint(contact.normal, contact.place, contact.distance);
    written.push_back(manifold.getContactPoint(0));
    remove_all(manifold);
    take_impulses(kept, reach, written.back());
  }
  for (const btManifoldPoint& contact : written) manifold.addManifoldPoint(contact);
}

MeshCollisionConfiguration::MeshCollisionConfiguration(
    const btDefaultCollisionConstructionInfo& info)
    : btDefaultCollisionConfiguration([&] {
        btDefaultCollisionConstructionInfo with_room = info;
        with_room.m_customCollisionAlgorithmMaxElementSize =
            std::max({info.m_customCollisionAlgorithmMaxElementSize, int(sizeof(TriangleAlgorithm)),
                      int(sizeof(MeshAlgorithm))});
        return with_room;
      }()) {
  on_triangle_.contacts = on_mesh_.contacts = mesh_on_.contacts = &contacts_;
  mesh_on_.is_mesh_first = true;
}

btCollisionAlgorithm* MeshCollisionConfiguration::OnTriangle::CreateCollisionAlgorithm(
    btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* convex,
    const btCollisionObjectWrapper* triangle) {
  void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(TriangleAlgorithm));
  return new (memory) TriangleAlgorithm(info, convex, triangle, *usual, *contacts);
}

btCollisionAlgorithm* MeshCollisionConfiguration::OnMesh::CreateCollisionAlgorithm(
    btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* first,
    const btCollisionObjectWrapper* second) {
  void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(MeshAlgorithm));
  return new (memory) MeshAlgorithm(info, first, second, is_mesh_first, *contacts);
}

btCollisionAlgorithmCreateFunc* MeshCollisionConfiguration::getCollisionAlgorithmCreateFunc(
    int first_type, int second_type) {
  btCollisionAlgorithmCreateFunc* const usual =
      btDefaultCollisionConfiguration::getCollisionAlgorithmCreateFunc(first_type, second_type);
  if (usual == m_convexConcaveCreateFunc) return &on_mesh_;
  if (usual == m_swappedConvexConcaveCreateFunc) return &mesh_on_;
  // Spheres have an algorithm of their own.
  if (second_type != TRIANGLE_SHAPE_PROXYTYPE || usual != m_convexConvexCreateFunc) return usual;
  on_triangle_.usual = static_cast<btConvexConvexAlgorithm::CreateFunc*>(usual);
  return &on_triangle_;
}

}  // namespace diorama
