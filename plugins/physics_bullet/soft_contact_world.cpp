// SPDX-License-Identifier: Apache-2.0
#include "soft_contact_world.h"

#include <algorithm>
#include <array>
#include <optional>

#include "hull_shape.h"
#include "shape_cache.h"

namespace diorama {
namespace {

/// With which share of their last impulses Bullet lets contacts begin a step, all of them.
constexpr double kWarmStart = 0.85;

/// Shows a body as convex while Bullet decides whether to sweep it. The sweep itself uses a sphere,
/// never the shape.
class ConvexDisguise {
 public:
  ConvexDisguise(btRigidBody& body, btCollisionShape& stand_in)
      : body_(body), shape_(body.getCollisionShape()) {
    if (shape_->isCompound()) body_.setCollisionShape(&stand_in);
  }
  ~ConvexDisguise() {
    if (shape_->isCompound()) body_.setCollisionShape(shape_);
  }
  ConvexDisguise(const ConvexDisguise&) = delete;
  ConvexDisguise& operator=(const ConvexDisguise&) = delete;

 private:
  btRigidBody& body_;
  btCollisionShape* shape_;
};

/// A contact between a moving body and a fixed thing, seen from the body.
struct FixedContact {
  const btCollisionObject* body = nullptr;
  const btCollisionObject* fixed = nullptr;
  bool is_fixed_second = true;
  int part = -1;      ///< Which child of a compound body touches.
  int triangle = -1;  ///< Which triangle of a mesh is touched.
  btVector3 push;     ///< Direction in which the contact pushes the body.
  btVector3 on_body;  ///< Point of the body, world.
  btVector3 touched;  ///< Point of the fixed thing, world.
  /// Where the body's centre of mass was when nothing was deep in it, world.
  btVector3 origin{0.0, 0.0, 0.0};

  const StaticMesh* mesh() const { return static_cast<const StaticMesh*>(fixed->getUserPointer()); }
  const btBoxShape* box() const {
    const btCollisionShape* shape = fixed->getCollisionShape();
    const bool is_box = shape->getShapeType() == BOX_SHAPE_PROXYTYPE;
    return is_box ? static_cast<const btBoxShape*>(shape) : nullptr;
  }
  double margin() const { return mesh() ? mesh()->shape->getMargin() : box()->getMargin(); }
};

/// Nothing unless one of the two is fixed and made of triangles or a box.
std::optional<FixedContact> fixed_contact(const btPersistentManifold& manifold,
                                          const btManifoldPoint& contact,
                                          const std::vector<btVector3>& clear_centres) {
  const btCollisionObject* a = manifold.getBody0();
  const btCollisionObject* b = manifold.getBody1();
  FixedContact seen{};
  if (b->isStaticObject()) {
    seen = {a,
            b,
            true,
            contact.m_index0,
            contact.m_index1,
            contact.m_normalWorldOnB,
            contact.m_positionWorldOnA,
            contact.m_positionWorldOnB};
  } else if (a->isStaticObject()) {
    seen = {b,
            a,
            false,
            contact.m_index1,
            contact.m_index0,
            -contact.m_normalWorldOnB,
            contact.m_positionWorldOnB,
            contact.m_positionWorldOnA};
  } else {
    return std::nullopt;
  }
  if (seen.mesh() ? seen.triangle < 0 : !seen.box()) return std::nullopt;
  seen.origin = clear_centres[std::size_t(seen.body->getUserIndex())];
  return seen;
}

/// A flat piece of a fixed thing, world. The corners run round it in one sense.
struct Facet {
  std::array<btVector3, 4> corners;
  std::size_t corner_count = 0;  ///< 3 or 4.
  btVector3 normal;              ///< Of the corners' sense.
  btVector3 outward;             ///< Along or against the normal.
};

/// The touched triangle, outward to the side from which the body came.
Facet triangle_facet(const FixedContact& seen) {
  Facet facet;
  const StaticMesh& mesh = *seen.mesh();
  for (const std::uint32_t corner : mesh.triangles[std::size_t(seen.triangle)]) {
    const Vec3f& p = mesh.positions[corner];
    facet.corners[facet.corner_count++] =
        seen.fixed->getWorldTransform() * btVector3(p.x(), p.y(), p.z());
  }
  const btVector3 along = facet.corners[1] - facet.corners[0];
  facet.normal = along.cross(facet.corners[2] - facet.corners[0]).normalized();
  const btVector3 to_centre = seen.origin - facet.corners[0];
  facet.outward = facet.normal.dot(to_centre) >= 0.0 ? facet.normal : -facet.normal;
  return facet;
}

/// Whether the touched point lies at an edge where a body may leave the triangle sideways.
bool is_at_open_edge(const FixedContact& contact, const Facet& triangle) {
  constexpr double kNear = 1e-3;  // metres, and share of the triangle's height over the edge
  const bool from_front = triangle.outward.dot(triangle.normal) > 0.0;
  const InnerEdges edges = contact.mesh()->inner_edges[std::size_t(contact.triangle)];
  for (int i = 0; i < 3; ++i) {
    const btVector3& start = triangle.corners[std::size_t(i)];
    const btVector3 along = (triangle.corners[std::size_t(i + 1) % 3] - start).normalized();
    const btVector3 inward = triangle.normal.cross(along);
    const double height = inward.dot(triangle.corners[std::size_t(i + 2) % 3] - start);
    const double inside = inward.dot(contact.touched - start);
    if (inside < std::max(kNear * height, std::min(kNear, 0.1 * height)) &&
        !edges.is_inner(i, from_front)) {
      return true;
    }
  }
  return false;
}

/// A convex shape of a body and its place in the world.
struct PlacedPart {
  const btConvexShape* shape;
  btTransform place;

  btVector3 farthest(const btVector3& direction) const {
    return place * shape->localGetSupportingVertex(place.getBasis().transpose() * direction);
  }
};

PlacedPart part_of(const btCollisionObject& body, int part) {
  const btTransform& place = body.getWorldTransform();
  const btCollisionShape* shape = body.getCollisionShape();
  if (!shape->isCompound()) return {static_cast<const btConvexShape*>(shape), place};
  const auto& compound = static_cast<const btCompoundShape&>(*shape);
  return {static_cast<const btConvexShape*>(compound.getChildShape(part)),
          place * compound.getChildTransform(part)};
}

/// Whether a contact with that normal is one of a round flank, which has no face to lie on.
bool is_on_flank(const btCollisionObject& body, int part, const btVector3& normal) {
  constexpr double kFlat = 0.9;  // cosine of the normal to the axis
  const btCollisionShape* shape = body.getCollisionShape();
  if (!shape->isConvex() && !shape->isCompound()) return false;
  const auto [convex, place] = part_of(body, part);
  int axis = 0;
  switch (convex->getShapeType()) {
    case CYLINDER_SHAPE_PROXYTYPE:
      axis = static_cast<const btCylinderShape*>(convex)->getUpAxis();
      break;
    case CONE_SHAPE_PROXYTYPE:
      axis = static_cast<const btConeShape*>(convex)->getConeUpIndex();
      break;
    case CAPSULE_SHAPE_PROXYTYPE:
      axis = static_cast<const btCapsuleShape*>(convex)->getUpAxis();
      break;
    default:
      return false;
  }
  return std::abs(place.getBasis().getColumn(axis).dot(normal)) < kFlat;
}

bool can_roll(const btPersistentManifold& manifold) {
  const btManifoldPoint& contact = manifold.getContactPoint(0);
  return is_on_flank(*manifold.getBody0(), contact.m_index0, contact.m_normalWorldOnB) ||
         is_on_flank(*manifold.getBody1(), contact.m_index1, contact.m_normalWorldOnB);
}

/// The farthest point of a whole body, world.
btVector3 support_point(const btCollisionObject& body, const btVector3& direction) {
  const btCollisionShape& shape = *body.getCollisionShape();
  const int count =
      shape.isCompound() ? static_cast<const btCompoundShape&>(shape).getNumChildShapes() : 1;
  btVector3 farthest = part_of(body, 0).farthest(direction);
  for (int part = 1; part < count; ++part) {
    const btVector3 point = part_of(body, part).farthest(direction);
    if (direction.dot(point) > direction.dot(farthest)) farthest = point;
  }
  return farthest;
}

/// The face of the box that the whole body clears by the shortest way.
Facet exit_facet(const FixedContact& seen) {
  const btVector3 half = seen.box()->getHalfExtentsWithMargin();
  const btTransform& place = seen.fixed->getWorldTransform();
  Facet facet;
  int axis = 0;
  double shortest = kInfinity;
  for (int i = 0; i < 6; ++i) {
    const btVector3 outward = place.getBasis().getColumn(i / 2) * (i % 2 == 0 ? 1.0 : -1.0);
    const btVector3 deepest = support_point(*seen.body, -outward);
    const double way = half[i / 2] - outward.dot(deepest - place.getOrigin());
    if (way >= shortest) continue;
    shortest = way;
    axis = i / 2;
    facet.outward = outward;
  }
  facet.normal = facet.outward;
  const btVector3 middle = place.getOrigin() + facet.outward * half[axis];
  const btVector3 along = place.getBasis().getColumn((axis + 1) % 3) * half[(axis + 1) % 3];
  const btVector3 turn = facet.normal.cross(along.normalized());
  const btVector3 across = turn * half[(axis + 2) % 3];
  facet.corners = {middle - along - across, middle + along - across, middle + along + across,
                   middle - along + across};
  facet.corner_count = 4;
  return facet;
}

bool projects_inside(const Facet& facet, const btVector3& point) {
  for (std::size_t i = 0; i < facet.corner_count; ++i) {
    const btVector3 along = facet.corners[(i + 1) % facet.corner_count] - facet.corners[i];
    if (facet.normal.cross(along).dot(point - facet.corners[i]) < 0.0) return false;
  }
  return true;
}

/// Writes the contact anew.
void set_contact(const FixedContact& seen, const btVector3& on_body, const btVector3& push,
                 double distance, btManifoldPoint& contact) {
  const btVector3 on_fixed = on_body - push * distance;
  const btVector3 body_local = seen.body->getWorldTransform().invXform(on_body);
  const btVector3 fixed_local = seen.fixed->getWorldTransform().invXform(on_fixed);
  contact.setDistance(distance);
  if (seen.is_fixed_second) {
    contact.m_normalWorldOnB = push;
    contact.m_positionWorldOnA = on_body;
    contact.m_positionWorldOnB = on_fixed;
    contact.m_localPointA = body_local;
    contact.m_localPointB = fixed_local;
  } else {
    contact.m_normalWorldOnB = -push;
    contact.m_positionWorldOnA = on_fixed;
    contact.m_positionWorldOnB = on_body;
    contact.m_localPointA = fixed_local;
    contact.m_localPointB = body_local;
  }
}

enum class Verdict { Keep, Remove, Rebuild };

Facet facet_of(const FixedContact& seen) {
  return seen.mesh() ? triangle_facet(seen) : exit_facet(seen);
}

bool is_capsule(const FixedContact& seen) {
  return seen.body->getCollisionShape()->getShapeType() == CAPSULE_SHAPE_PROXYTYPE;
}

// Where only the skins overlap, Bullet's contact is exact.
bool is_deep(const FixedContact& seen, const btManifoldPoint& contact) {
  return contact.getDistance() < -2.0 * seen.margin();
}

/// What to do with a contact; turns it to the right side where that is enough.
Verdict mend_direction(const FixedContact& seen, btManifoldPoint& contact) {
  const bool deep = is_deep(seen, contact);
  if (!deep && !seen.mesh() && !is_capsule(seen)) return Verdict::Keep;
  const Facet facet = facet_of(seen);
  const double agreement = facet.outward.dot(seen.push);
  const bool agrees = agreement > 0.99;
  if (!deep && agrees) return is_capsule(seen) ? Verdict::Rebuild : Verdict::Keep;
  if (!seen.mesh()) return deep ? Verdict::Rebuild : Verdict::Keep;
  if (is_at_open_edge(seen, facet)) return agreement > -0.1 ? Verdict::Keep : Verdict::Remove;
  if (deep) return Verdict::Rebuild;
  set_contact(seen, seen.on_body, facet.outward, contact.getDistance(), contact);
  return Verdict::Keep;
}

/// Points of the touching part that a facet below it may touch: the corners of a hull or a box, the
/// two ends of a capsule, of other round shapes the lowest point and those found in directions that
/// lean to three sides. Bullet finds one point at a time, on which a body rocks, and deep in the
/// other thing often a poor one.
std::vector<btVector3> foot_points(const FixedContact& seen, const btVector3& outward) {
  const auto [shape, place] = part_of(*seen.body, seen.part);
  std::vector<btVector3> points;
  if (is_capsule(seen)) {
    const auto& capsule = static_cast<const btCapsuleShape&>(*shape);
    const btVector3 end = place.getBasis().getColumn(capsule.getUpAxis()) * capsule.getHalfHeight();
    const btVector3 middle = place.getOrigin() - outward * capsule.getRadius();
    return {middle - end, middle + end};
  }
  if (shape->isPolyhedral()) {
    const auto& polyhedron = static_cast<const btPolyhedralConvexShape&>(*shape);
    // A hull carries its margin outside of its corners, a box inside.
    const bool is_hull = shape->getShapeType() == HullShape::kShapeType;
    const btVector3 margin = outward * (is_hull ? shape->getMargin() : 0.0);
    for (int i = 0; i < polyhedron.getNumVertices(); ++i) {
      btVector3 corner;
      polyhedron.getVertex(i, corner);
      points.push_back(place * corner - margin);
    }
    return points;
  }
  constexpr double kLean = 0.4;
  btVector3 side, unused;
  btPlaneSpace1(outward, side, unused);
  points.push_back(PlacedPart{shape, place}.farthest(-outward));
  for (int i = 0; i < 3; ++i) {
    const btVector3 lean = side.rotate(outward, btScalar(2.0 * SIMD_PI / 3.0 * i));
    points.push_back(PlacedPart{shape, place}.farthest(kLean * lean - outward));
  }
  return points;
}

/// The candidate to add next: touching before near, far from those that are there. Null when only
/// repetitions are left.
const btManifoldPoint* next_contact(const std::vector<btManifoldPoint>& candidates,
                                    const btPersistentManifold& manifold) {
  constexpr double kApart = 1e-3;  // metres
  const btManifoldPoint* best = nullptr;
  double best_gap = 0.0;
  for (const btManifoldPoint& candidate : candidates) {
    double gap = kInfinity;
    for (int i = 0; i < manifold.getNumContacts(); ++i) {
      const btVector3& other = manifold.getContactPoint(i).m_localPointA;
      gap = std::min(gap, double(candidate.m_localPointA.distance(other)));
    }
    if (gap < kApart) continue;
    const bool touches = candidate.getDistance() < 0.0;
    const bool best_touches = best && best->getDistance() < 0.0;
    const bool is_better = !best || (touches != best_touches ? touches : gap > best_gap);
    if (!is_better) continue;
    best = &candidate;
    best_gap = gap;
  }
  return best;
}

/// Appends the contacts of the body's foot with the facet.
void rebuild_contacts(const FixedContact& seen, const btManifoldPoint& poor, double reach,
                      std::vector<btManifoldPoint>& contacts) {
  const Facet facet = facet_of(seen);
  // Bullet's boxes hold their margin inside, its triangles carry it outside.
  const double skin = seen.mesh() ? seen.margin() : 0.0;
  for (const btVector3& point : foot_points(seen, facet.outward)) {
    const double distance = facet.outward.dot(point - facet.corners[0]) - skin;
    if (distance > reach || !projects_inside(facet, point)) continue;
    btManifoldPoint contact = poor;
    contact.m_appliedImpulse = contact.m_appliedImpulseLateral1 = 0.0;
    contact.m_appliedImpulseLateral2 = contact.m_prevRHS = 0.0;
    set_contact(seen, point, facet.outward, distance, contact);
    contacts.push_back(contact);
  }
  // It may hold up a capsule whose end hangs over an edge.
  if (!is_deep(seen, poor)) contacts.push_back(poor);
}

/// The contact turned to the right side, not deeper than the body reaches under the facet.
void turn_deep_contact(const FixedContact& seen, btManifoldPoint contact,
                       btPersistentManifold& manifold) {
  const Facet facet = facet_of(seen);
  const btVector3 deepest = part_of(*seen.body, seen.part).farthest(-facet.outward);
  const double depth = std::max(double(contact.getDistance()),
                                double(facet.outward.dot(deepest - facet.corners[0])));
  set_contact(seen, seen.on_body, facet.outward, depth, contact);
  manifold.addManifoldPoint(contact);
}

/// Whether the body moves so slowly that rolling friction can hold it, and a small tilt would lower
/// its centre of mass over a plane: it balances. What rolls keeps its height, within half of what
/// is lost on an edge.
bool is_balancing(const btRigidBody& body, const btVector3& up) {
  constexpr double kSlow = 0.03;  // m/s
  constexpr double kTilt = 0.1;   // radians
  if (body.getLinearVelocity().length2() > kSlow * kSlow) return false;
  const btVector3& centre = body.getWorldTransform().getOrigin();
  const auto height = [&](const btVector3& direction) {
    return direction.dot(centre - support_point(body, -direction));
  };
  const double lowered = height(up) * (1.0 - 0.25 * kTilt * kTilt);
  btVector3 side, unused;
  btPlaneSpace1(up, side, unused);
  for (int i = 0; i < 8; ++i) {
    const btVector3 sideways = side.rotate(up, btScalar(0.25 * SIMD_PI * i));
    if (height(up * std::cos(kTilt) + sideways * std::sin(kTilt)) < lowered) return true;
  }
  return false;
}

}  // namespace

SoftContactWorld::SoftContactWorld(btDispatcher* dispatcher, btBroadphaseInterface* broadphase,
                                   btConstraintSolver* solver,
                                   btCollisionConfiguration* configuration,
                                   double max_depenetration_speed)
    : btDiscreteDynamicsWorld(dispatcher, broadphase, solver, configuration),
      max_depenetration_speed_(max_depenetration_speed) {
  getSolverInfo().m_warmstartingFactor = 1.0;
}

/// Where the body was clear goes with the thing that it is deep in.
void SoftContactWorld::note_depth(const btCollisionObject& body, const btCollisionObject& fixed) {
  const std::size_t index = std::size_t(body.getUserIndex());
  is_clear_[index] = false;
  const btRigidBody* const carried = btRigidBody::upcast(&fixed);
  if (!carried) return;
  const btVector3 arm = clear_centres_[index] - carried->getWorldTransform().getOrigin();
  const btVector3 velocity = carried->getVelocityInLocalPoint(arm);
  if (velocity.length2() > drifts_[index].length2()) drifts_[index] = velocity;
}

void SoftContactWorld::repair_contacts(btPersistentManifold& manifold, double lowest_distance) {
  const auto fixed = [&](const btManifoldPoint& contact) {
    return fixed_contact(manifold, contact, clear_centres_);
  };
  rebuilt_.clear();
  for (int i = manifold.getNumContacts() - 1; i >= 0; --i) {
    btManifoldPoint& contact = manifold.getContactPoint(i);
    const auto seen = fixed(contact);
    if (!seen) continue;
    if (is_deep(*seen, contact)) note_depth(*seen->body, *seen->fixed);
    const Verdict verdict = mend_direction(*seen, contact);
    if (verdict == Verdict::Keep) continue;
    const bool is_known = std::any_of(rebuilt_.begin(), rebuilt_.end(), [&](const auto& other) {
      return other.m_index0 == contact.m_index0 && other.m_index1 == contact.m_index1;
    });
    if (verdict == Verdict::Rebuild && !is_known) rebuilt_.push_back(contact);
    manifold.removeContactPoint(i);
  }
  candidates_.clear();
  for (const btManifoldPoint& poor : rebuilt_) {
    rebuild_contacts(*fixed(poor), poor, manifold.getContactBreakingThreshold(), candidates_);
  }
  std::stable_sort(candidates_.begin(), candidates_.end(),
                   [](const auto& a, const auto& b) { return a.getDistance() < b.getDistance(); });
  while (manifold.getNumContacts() < MANIFOLD_CACHE_SIZE) {
    const btManifoldPoint* next = next_contact(candidates_, manifold);
    if (!next) break;
    manifold.addManifoldPoint(*next);
  }
  const bool touches = !candidates_.empty() && candidates_.front().getDistance() < 0.0;
  // On fine meshes no corner lies over the triangles that are met.
  for (std::size_t i = 0; !touches && i < rebuilt_.size(); ++i) {
    const FixedContact seen = *fixed(rebuilt_[i]);
    if (is_deep(seen, rebuilt_[i])) turn_deep_contact(seen, rebuilt_[i], manifold);
  }
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    btManifoldPoint& contact = manifold.getContactPoint(i);
    contact.setDistance(std::max(contact.getDistance(), lowest_distance));
  }
}

void SoftContactWorld::keep_steady_impulses(btPersistentManifold& manifold) {
  constexpr int kSteadySteps = 8;
  // What is still being pushed apart presses with too much already.
  constexpr double kTouching = -0.0005;  // metres
  // On fewer contacts things roll or rock.
  const bool is_on_face = manifold.getNumContacts() >= 3;
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    btManifoldPoint& contact = manifold.getContactPoint(i);
    const bool is_steady = contact.getLifeTime() >= kSteadySteps;
    if (is_on_face && is_steady && contact.getDistance() > kTouching) continue;
    contact.m_appliedImpulse *= kWarmStart;
    contact.m_appliedImpulseLateral1 *= kWarmStart;
    contact.m_appliedImpulseLateral2 *= kWarmStart;
  }
}

/// Puts the last step's contacts of a face in place of those that were found now, where both say
/// the same: they have neither slipped nor parted, and nothing reaches deeper elsewhere.
void SoftContactWorld::hold_face(btPersistentManifold& manifold, double lowest_distance) {
  constexpr double kSlip = 1e-3;       // metres
  constexpr double kDeeper = 5e-5;     // metres
  constexpr double kParallel = 0.999;  // cosine
  const auto known = faces_.find(&manifold);
  if (known == faces_.end() || manifold.getNumContacts() == 0) return;
  Face& face = known->second;
  // The manifold may have become one of other bodies.
  if (face.a != manifold.getBody0() || face.b != manifold.getBody1()) return;
  double lowest = kInfinity;
  for (int i = 0; i < face.count; ++i) {
    btManifoldPoint& contact = face.contacts[std::size_t(i)];
    contact.m_positionWorldOnA = face.a->getWorldTransform() * contact.m_localPointA;
    contact.m_positionWorldOnB = face.b->getWorldTransform() * contact.m_localPointB;
    contact.m_normalWorldOnB =
        face.b->getWorldTransform().getBasis() * face.normals[std::size_t(i)];
    const btVector3 apart = contact.m_positionWorldOnA - contact.m_positionWorldOnB;
    const double gap = apart.dot(contact.m_normalWorldOnB);
    const double slip = (apart - gap * contact.m_normalWorldOnB).length();
    if (slip > kSlip || gap > manifold.getContactBreakingThreshold()) return;
    contact.setDistance(gap);
    lowest = std::min(lowest, gap);
  }
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    const btManifoldPoint& found = manifold.getContactPoint(i);
    if (found.getDistance() < lowest - kDeeper) return;
    if (found.m_normalWorldOnB.dot(face.contacts[0].m_normalWorldOnB) < kParallel) return;
  }
  while (manifold.getNumContacts() > 0) manifold.removeContactPoint(manifold.getNumContacts() - 1);
  for (int i = 0; i < face.count; ++i) {
    btManifoldPoint contact = face.contacts[std::size_t(i)];
    ++contact.m_lifeTime;
    // Bullet draws the two points of such a contact together as far as friction can.
    contact.m_contactPointFlags |= BT_CONTACT_FLAG_FRICTION_ANCHOR;
    contact.setDistance(std::max(contact.getDistance(), lowest_distance));
    manifold.addManifoldPoint(contact);
  }
}

void SoftContactWorld::let_balance_go() {
  constexpr double kTouching = 2e-4;    // metres
  constexpr int kFace = 3;              // contacts
  constexpr double kLeastLever = 1e-9;  // metres; with none Bullet leaves out spinning, too
  struct Touches {
    int others = 0;
    int contacts = 0;
  };
  if (getGravity().isZero()) return;
  std::vector<Touches> touches(std::size_t(m_nonStaticRigidBodies.size()));
  btDispatcher& dispatcher = *getDispatcher();
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
    int count = 0;
    for (int k = 0; k < manifold.getNumContacts(); ++k) {
      if (manifold.getContactPoint(k).getDistance() < kTouching) ++count;
    }
    if (count == 0) continue;
    for (const btCollisionObject* body : {manifold.getBody0(), manifold.getBody1()}) {
      if (body->isStaticObject()) continue;
      Touches& seen = touches[std::size_t(body->getUserIndex())];
      ++seen.others;
      seen.contacts += count;
    }
  }
  const btVector3 up = -getGravity().normalized();
  const auto lever = [&](const btCollisionObject& body) {
    if (body.isStaticObject()) return 0.0;
    const Touches& seen = touches[std::size_t(body.getUserIndex())];
    const bool is_on_edge = seen.others == 1 && seen.contacts < kFace;
    if (is_on_edge && is_balancing(*btRigidBody::upcast(&body), up)) return 0.0;
    return double(body.getRollingFriction());
  };
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
    if (manifold.getNumContacts() == 0) continue;
    const btCollisionObject& a = *manifold.getBody0();
    const btCollisionObject& b = *manifold.getBody1();
    const double combined = lever(a) * b.getFriction() + lever(b) * a.getFriction();
    for (int k = 0; k < manifold.getNumContacts(); ++k) {
      manifold.getContactPoint(k).m_combinedRollingFriction = std::max(combined, kLeastLever);
    }
  }
}

/// With the impulses that the step ended with. What lies on fewer contacts or on a round flank
/// rolls or rocks: kept contacts would stay behind and push it on.
void SoftContactWorld::note_faces() {
  std::map<const btPersistentManifold*, Face> faces;
  btDispatcher& dispatcher = *getDispatcher();
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
    if (manifold.getNumContacts() < 3 || can_roll(manifold)) continue;
    Face& face = faces[&manifold];
    face.a = manifold.getBody0();
    face.b = manifold.getBody1();
    face.count = manifold.getNumContacts();
    const btMatrix3x3 b_from_world = face.b->getWorldTransform().getBasis().transpose();
    for (int k = 0; k < face.count; ++k) {
      face.contacts[std::size_t(k)] = manifold.getContactPoint(k);
      face.normals[std::size_t(k)] = b_from_world * manifold.getContactPoint(k).m_normalWorldOnB;
    }
  }
  faces_.swap(faces);
}

void SoftContactWorld::solveConstraints(btContactSolverInfo& info) {
  // The solver undoes the share erp2 of a depth per step. Contact detection writes the distances
  // anew before the next step.
  const double lowest = -max_depenetration_speed_ * info.m_timeStep / info.m_erp2;
  for (std::size_t i = clear_centres_.size(); i < std::size_t(m_nonStaticRigidBodies.size()); ++i) {
    clear_centres_.push_back(m_nonStaticRigidBodies[int(i)]->getWorldTransform().getOrigin());
  }
  is_clear_.assign(clear_centres_.size(), true);
  drifts_.assign(clear_centres_.size(), btVector3(0.0, 0.0, 0.0));
  btDispatcher& dispatcher = *getDispatcher();
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
    repair_contacts(manifold, lowest);
    hold_face(manifold, lowest);
    keep_steady_impulses(manifold);
  }
  let_balance_go();
  for (std::size_t i = 0; i < clear_centres_.size(); ++i) {
    if (is_clear_[i]) {
      clear_centres_[i] = m_nonStaticRigidBodies[int(i)]->getWorldTransform().getOrigin();
    } else {
      clear_centres_[i] += drifts_[i] * info.m_timeStep;
    }
  }
  btDiscreteDynamicsWorld::solveConstraints(info);
  // Before the bodies move on.
  note_faces();
}

void SoftContactWorld::createPredictiveContacts(btScalar seconds) {
  releasePredictiveContacts();
  for (int i = 0; i < m_nonStaticRigidBodies.size(); ++i) {
    const ConvexDisguise disguise(*m_nonStaticRigidBodies[i], stand_in_);
    createPredictiveContactsInternal(&m_nonStaticRigidBodies[i], 1, seconds);
  }
}

void SoftContactWorld::integrateTransforms(btScalar seconds) {
  for (int i = 0; i < m_nonStaticRigidBodies.size(); ++i) {
    const ConvexDisguise disguise(*m_nonStaticRigidBodies[i], stand_in_);
    integrateTransformsInternal(&m_nonStaticRigidBodies[i], 1, seconds);
  }
}

}  // namespace diorama
