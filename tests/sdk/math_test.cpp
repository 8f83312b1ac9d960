// SPDX-License-Identifier: Apache-2.0
#include "diorama/math.h"

#include "diorama/rng.h"
#include "error_text.h"
#include "support/catch.h"

using namespace diorama;

namespace {

Transform random_transform(Rng& rng, double x_sign) {
  Transform transform;
  transform.translation = 10.0 * rng.unit_vector();
  transform.rotation = rng.uniform_rotation();
  transform.scale =
      Vec3(x_sign * rng.uniform(0.1, 5.0), rng.uniform(0.1, 5.0), rng.uniform(0.1, 5.0));
  return transform;
}

}  // namespace

TEST_CASE("A transform scales, then rotates, then translates", "[math]") {
  Transform transform;
  transform.translation = Vec3(10, 20, 30);
  transform.rotation = Quat(Eigen::AngleAxisd(kPi / 2, Vec3::UnitZ()));
  transform.scale = Vec3(2, 3, 4);
  CHECK((transform.affine() * Vec3(1, 1, 1)).isApprox(Vec3(7, 22, 34), 1e-12));
}

TEST_CASE("Splitting an affine map gives back the transform, mirrored ones too", "[math]") {
  Rng rng(1);
  for (int i = 0; i < 200; ++i) {
    const Transform transform = random_transform(rng, i % 2 ? -1.0 : 1.0);
    const Transform again = Transform::from_affine(transform.affine());
    CHECK(again.scale.isApprox(transform.scale, 1e-9));
    CHECK(again.rotation.angularDistance(transform.rotation) < 1e-7);
    CHECK(again.translation == transform.translation);
  }
}

TEST_CASE("A map mirrored along any axis is kept as a map", "[math]") {
  const Quat rotation(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  for (const Vec3& scale : {Vec3(2, -3, 4), Vec3(2, 3, -4), Vec3(-2, -3, -4), Vec3(-2, -3, 4)}) {
    Affine map = Affine::Identity();
    map.linear() = rotation.toRotationMatrix() * scale.asDiagonal();
    const Transform transform = Transform::from_affine(map);
    CHECK(transform.affine().isApprox(map, 1e-9));
    CHECK(transform.rotation.toRotationMatrix().determinant() == Approx(1.0));
  }
}

TEST_CASE("A sheared map gives its nearest rotation and loses the shear", "[math]") {
  // Known answer: for a shear x += 2 k y the polar rotation turns by -atan(k) about z.
  const double k = 0.25;
  Affine map = Affine::Identity();
  map.linear()(0, 1) = 2.0 * k;
  const Transform transform = Transform::from_affine(map);
  const Quat expected(Eigen::AngleAxisd(-std::atan(k), Vec3::UnitZ()));
  CHECK(transform.rotation.angularDistance(expected) < 1e-7);
  CHECK(transform.scale.z() == Approx(1.0));
  CHECK_FALSE(transform.affine().isApprox(map, 1e-3));
}

TEST_CASE("A flattened map still gives a rotation", "[math]") {
  Affine map = Affine::Identity();
  map.linear() = Vec3(2, 0, 0.5).asDiagonal();
  const Transform transform = Transform::from_affine(map);
  CHECK(transform.rotation.toRotationMatrix().determinant() == Approx(1.0));
  CHECK(transform.affine().isApprox(map, 1e-9));
}

TEST_CASE("A box grows by points and boxes and stays empty without any", "[math]") {
  Aabb box;
  CHECK(box.is_empty());
  CHECK(box.mapped(Affine(Eigen::Translation3d(1, 2, 3))).is_empty());
  box.add(Aabb());
  CHECK(box.is_empty());
  box.add(Vec3(1, -2, 3));
  CHECK_FALSE(box.is_empty());
  box.add(Aabb{Vec3(0, 0, 0), Vec3(5, 1, 4)});
  CHECK(box.min == Vec3(0, -2, 0));
  CHECK(box.max == Vec3(5, 1, 4));
  CHECK(box.centre() == Vec3(2.5, -0.5, 2));
}

TEST_CASE("The corners of a box count in binary: x, y, z", "[math]") {
  const Aabb box{Vec3(1, 2, 3), Vec3(10, 20, 30)};
  CHECK(box.corner(0) == Vec3(1, 2, 3));
  CHECK(box.corner(1) == Vec3(10, 2, 3));
  CHECK(box.corner(2) == Vec3(1, 20, 3));
  CHECK(box.corner(4) == Vec3(1, 2, 30));
  CHECK(box.corner(7) == Vec3(10, 20, 30));
}

TEST_CASE("A mapped box holds the mapped corners", "[math]") {
  const Aabb box{Vec3(-1, -2, 0), Vec3(1, 2, 1)};
  const Affine quarter_turn(Eigen::AngleAxisd(kPi / 2, Vec3::UnitZ()));
  const Aabb turned = box.mapped(quarter_turn);
  CHECK(turned.min.isApprox(Vec3(-2, -1, 0), 1e-12));
  CHECK(turned.max.isApprox(Vec3(2, 1, 1), 1e-12));
}

TEST_CASE("A look rotation turns -z to the target and keeps x level", "[math]") {
  Rng rng(2);
  for (int i = 0; i < 100; ++i) {
    const Vec3 forward = 3.0 * rng.unit_vector();
    const Quat rotation = look_rotation(forward);
    CHECK((rotation * -Vec3::UnitZ()).isApprox(forward.normalized(), 1e-9));
    CHECK((rotation * Vec3::UnitX()).z() == Approx(0.0).margin(1e-12));
    CHECK((rotation * Vec3::UnitY()).z() >= 0.0);
  }
}

TEST_CASE("Looking straight up or down takes +y as up", "[math]") {
  const Quat down = look_rotation(Vec3(0, 0, -5));
  CHECK((down * Vec3::UnitY()).isApprox(Vec3::UnitY(), 1e-12));
  CHECK((down * -Vec3::UnitZ()).isApprox(-Vec3::UnitZ(), 1e-12));
  const Quat along_both = look_rotation(Vec3::UnitY(), Vec3::UnitY());
  CHECK((along_both * -Vec3::UnitZ()).isApprox(Vec3::UnitY(), 1e-12));
}

TEST_CASE("Looking nowhere is an error", "[math]") {
  const std::string expected =
      "look_rotation: the viewing direction must be a finite vector other than zero";
  CHECK(test::error_text([] { look_rotation(Vec3::Zero()); }) == expected);
  CHECK(test::error_text([] { look_rotation(Vec3(0, kInfinity, 0)); }) == expected);
}
