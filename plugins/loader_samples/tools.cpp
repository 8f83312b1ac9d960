// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "loader_samples/model.h"

namespace diorama::samples {

using namespace modelling;

namespace {

MaterialPtr steel() { return make_plain("steel", color(0xbfc2c5), 0.25, 1.0); }

/// Cordless drill: z up with the battery as its foot, the chuck along +x.
Model power_drill(Host&, Rng) {
  MeshBuilder builder;
  const auto part = [&](const Affine& pose, std::uint16_t slot) {
    builder.begin(pose, {slot, 1.0});
  };
  // Motor housing, from the back to the gear box.
  std::vector<PathPoint> housing;
  const std::array<Vec3, 9> sizes{
      Vec3(-0.068, 0.012, 0.012), Vec3(-0.066, 0.020, 0.021), Vec3(-0.058, 0.0255, 0.027),
      Vec3(-0.03, 0.0280, 0.030), Vec3(0.0, 0.0285, 0.0305),  Vec3(0.03, 0.0275, 0.029),
      Vec3(0.046, 0.0250, 0.026), Vec3(0.052, 0.0235, 0.024), Vec3(0.053, 0.018, 0.018)};
  for (const Vec3& s : sizes) housing.push_back({Vec3(s.x(), 0, 0.150), s.y(), s.z()});
  part(Affine::Identity(), 0);
  add_sweep(builder, housing, 40, Vec3::UnitZ(), 2.7);
  // Gear box, clutch ring and chuck.
  const std::array<ProfilePoint, 6> gear{
      {{0, 0.048}, {0.0225, 0.048}, {0.0225, 0.066}, {0.0205, 0.070}, {0.0195, 0.071}, {0, 0.071}}};
  part(at(0, 0, 0.150) * turned_y(kPi / 2), 1);
  add_lathe(builder, gear, 48, 0.6);
  for (int i = 0; i < 16; ++i) {
    const double a = 2 * kPi * i / 16;
    part(at(0.058, 0.0226 * std::cos(a), 0.150 + 0.0226 * std::sin(a)) * turned_x(a), 2);
    add_box(builder, Vec3(0.014, 0.002, 0.004), 0.0007, Axis::X);
  }
  const std::array<ProfilePoint, 9> chuck{{{0, 0.070},
                                           {0.0165, 0.070},
                                           {0.0175, 0.073},
                                           {0.0175, 0.090},
                                           {0.0160, 0.092},
                                           {0.0160, 0.098},
                                           {0.0085, 0.111},
                                           {0.0060, 0.112},
                                           {0, 0.112}}};
  part(at(0, 0, 0.150) * turned_y(kPi / 2), 1);
  add_lathe(builder, chuck, 48, 0.6);
  const std::array<ProfilePoint, 4> bit{{{0, 0.108}, {0.0030, 0.108}, {0.0030, 0.122}, {0, 0.123}}};
  part(at(0, 0, 0.150) * turned_y(kPi / 2), 3);
  add_lathe(builder, bit, 24, 0.6);
  // Handle, leaning back, and its rubber grip.
  const std::array<PathPoint, 6> handle{PathPoint{Vec3(-0.020, 0, 0.135), 0.018, 0.025},
                                        PathPoint{Vec3(-0.024, 0, 0.110), 0.0165, 0.0215},
                                        PathPoint{Vec3(-0.029, 0, 0.085), 0.0160, 0.0195},
                                        PathPoint{Vec3(-0.034, 0, 0.060), 0.0165, 0.0190},
                                        PathPoint{Vec3(-0.037, 0, 0.045), 0.020, 0.024},
                                        PathPoint{Vec3(-0.038, 0, 0.036), 0.024, 0.030}};
  part(Affine::Identity(), 0);
  add_sweep(builder, handle, 32, Vec3::UnitX(), 2.6);
  const std::array<PathPoint, 4> grip{PathPoint{Vec3(-0.0275, 0, 0.118), 0.0168, 0.0208},
                                      PathPoint{Vec3(-0.0300, 0, 0.100), 0.0172, 0.0212},
                                      PathPoint{Vec3(-0.0330, 0, 0.080), 0.0168, 0.0204},
                                      PathPoint{Vec3(-0.0362, 0, 0.058), 0.0170, 0.0198}};
  part(Affine::Identity(), 1);
  add_sweep(builder, grip, 32, Vec3::UnitX(), 2.6);
  part(at(0.000, 0, 0.112) * turned_y(0.25), 2);
  add_box(builder, Vec3(0.012, 0.014, 0.026), 0.004, Axis::Z, 3);
  // Battery.
  part(at(-0.026, 0, 0.020), 1);
  add_box(builder, Vec3(0.105, 0.066, 0.034), 0.007, Axis::X, 3);
  part(at(-0.026, 0, 0.0385), 0);
  add_box(builder, Vec3(0.092, 0.058, 0.010), 0.004, Axis::X, 3);
  // A printed plate on either side.
  Canvas c(256, 96, color(0x1e1f22));
  c.rectangle(4, 4, 248, 88, color(0xf0a21e), 10);
  c.centred_text(128, 62, 34, "TORKO 18", color(0x1e1f22), 0.2);
  for (const double side : {-1.0, 1.0}) {
    part(at(-0.008, side * 0.0283, 0.150) * turned_z(side < 0 ? 0 : kPi), 4);
    const UvRect dull{Vec2(0.01, 0.01), Vec2(0.012, 0.012)};
    add_printed_box(builder, Vec3(0.056, 0.0016, 0.021), 0.0005,
                    {dull, dull, UvRect{}, dull, dull, dull});
  }
  return finish(builder, {make_plain("orange_plastic", color(0xd9541e), 0.38),
                          make_plain("black_rubber", color(0x202123), 0.55),
                          make_plain("red_switch", color(0x9d1f1c), 0.4), steel(),
                          make_picture_material("plate", c.texture("plate"), 0.35)});
}

/// A closed loop of round cord: the grips of scissors.
void add_grip(MeshBuilder& builder, double cx, double cy, double rx, double ry, double turn,
              double thick) {
  std::vector<PathPoint> path;
  constexpr int kSteps = 48;
  for (int i = 0; i <= kSteps; ++i) {
    const double a = 2 * kPi * (i + 0.02) / kSteps * 0.9995;
    const Vec3 p(rx * std::cos(a), ry * std::sin(a), 0);
    path.push_back({at(cx, cy, 0.006) * turned_z(turn) * p, thick, 0.0052});
  }
  add_sweep(builder, path, 18, Vec3::UnitZ(), 2.8);
}

Model scissors(Host&, Rng) {
  MeshBuilder builder;
  for (const double side : {-1.0, 1.0}) {
    // Each blade crosses over at the screw.
    const double z = side < 0 ? 0.0040 : 0.0062;
    const std::array<Vec2, 6> blade{Vec2(-0.006, -0.020), Vec2(0.0045, -0.022),
                                    Vec2(0.0075, 0.010),  Vec2(0.0050, 0.060),
                                    Vec2(0.0006, 0.101),  Vec2(-0.0035, 0.030)};
    builder.begin(at(0, 0, z) * turned_z(side * 0.10) * scaled(side, 1, 1), {0, 1.0});
    add_prism(builder, blade, 0.0019, 0.0005);
    const std::array<PathPoint, 5> shank{
        PathPoint{Vec3(side * 0.001, -0.014, 0.006), 0.0065, 0.0042},
        PathPoint{Vec3(-side * 0.004, -0.030, 0.006), 0.0062, 0.0048},
        PathPoint{Vec3(-side * 0.009, -0.046, 0.006), 0.0055, 0.0052},
        PathPoint{Vec3(-side * 0.012, -0.056, 0.006), 0.0050, 0.0052},
        PathPoint{Vec3(-side * 0.014, -0.062, 0.006), 0.0046, 0.0050}};
    builder.begin(Affine::Identity(), {1, 1.0});
    add_sweep(builder, shank, 18, Vec3::UnitZ(), 2.6);
    builder.begin(Affine::Identity(), {1, 1.0});
    add_grip(builder, -side * 0.0235, -0.076, 0.0165, side < 0 ? 0.026 : 0.0215, -side * 0.35,
             0.0042);
  }
  const std::array<ProfilePoint, 5> screw{
      {{0, 0.0032}, {0.0045, 0.0032}, {0.0045, 0.0090}, {0.0035, 0.0098}, {0, 0.0100}}};
  builder.begin(Affine::Identity(), {0, 1.0});
  add_lathe(builder, screw, 24, 0.6);
  return finish(builder, {steel(), make_plain("handle_plastic", color(0xd46a1f), 0.4)});
}

Model large_marker(Host&, Rng) {
  MeshBuilder builder;
  const Affine lying = turned_y(kPi / 2);
  Canvas c(512, 256, color(0xf2f2ee));
  c.rectangle(0, 0, 512, 26, color(0x1b1b1d));
  for (const double y : {96.0, 224.0}) {
    c.text(40, y, 46, "INKWELL", color(0x1b1b1d), 0.2);
    c.text(330, y - 6, 30, "BROAD", color(0xb3261e), 0.18);
  }
  builder.begin(lying, {0, 1.0});
  const std::array<ProfilePoint, 6> body{{{0, -0.0585},
                                          {0.0080, -0.0585},
                                          {0.0090, -0.0575},
                                          {0.0090, 0.024},
                                          {0.0086, 0.0245},
                                          {0, 0.0245}}};
  add_lathe_unit_uv(builder, body, 40, 0, 1, 0.6);
  const std::array<ProfilePoint, 8> cap{{{0, 0.0240},
                                         {0.0094, 0.0240},
                                         {0.0096, 0.0250},
                                         {0.0090, 0.055},
                                         {0.0082, 0.0600},
                                         {0.0070, 0.0605},
                                         {0.0070, 0.0600},
                                         {0, 0.0600}}};
  builder.begin(lying, {1, 1.0});
  add_lathe(builder, cap, 40, 0.6);
  builder.begin(at(0.040, 0, 0.0104), {1, 1.0});
  add_box(builder, Vec3(0.034, 0.0045, 0.0024), 0.001, Axis::X, 2);
  return finish(builder, {make_picture_material("barrel", c.texture("marker"), 0.35),
                          make_plain("cap", color(0x1c1c1f), 0.4)});
}

/// A spring clamp, lying: two handles, jaws and the spring.
Model spring_clamp(double scale) {
  MeshBuilder builder;
  const Affine size = scaled(scale, scale, scale);
  for (const double side : {-1.0, 1.0}) {
    const std::array<Vec3, 7> knots{
        Vec3(side * 0.046, -0.075, 0.012), Vec3(side * 0.038, -0.045, 0.012),
        Vec3(side * 0.022, -0.012, 0.012), Vec3(side * 0.012, 0.004, 0.012),
        Vec3(side * 0.022, 0.022, 0.012),  Vec3(side * 0.024, 0.036, 0.012),
        Vec3(side * 0.009, 0.053, 0.012)};
    std::vector<PathPoint> arm;
    const auto curve = smooth_path(knots, 6);
    for (std::size_t i = 0; i < curve.size(); ++i) {
      const double t = double(i) / double(curve.size() - 1);
      arm.push_back({curve[i], 0.0065 - 0.0018 * t, 0.0105 - 0.003 * std::abs(2 * t - 1)});
    }
    builder.begin(size, {0, 1.0});
    add_sweep(builder, arm, 22, Vec3::UnitZ(), 4.0);
    const std::array<PathPoint, 3> grip{
        PathPoint{Vec3(side * 0.0475, -0.080, 0.012), 0.0075, 0.0112},
        PathPoint{Vec3(side * 0.0425, -0.062, 0.012), 0.0085, 0.0118},
        PathPoint{Vec3(side * 0.0355, -0.040, 0.012), 0.0078, 0.0114}};
    builder.begin(size, {1, 1.0});
    add_sweep(builder, grip, 22, Vec3::UnitZ(), 4.0);
    builder.begin(size * at(side * 0.006, 0.053, 0.012) * turned_z(side * 0.1), {1, 1.0});
    add_box(builder, Vec3(0.010, 0.016, 0.020), 0.003, Axis::Y, 3);
  }
  const std::array<ProfilePoint, 6> pin{
      {{0, 0}, {0.0075, 0}, {0.0082, 0.0012}, {0.0082, 0.0228}, {0.0075, 0.024}, {0, 0.024}}};
  builder.begin(size * at(0, 0.002, 0), {2, 1.0});
  add_lathe(builder, pin, 32, 0.7);
  std::vector<Vec3> coil;
  for (int i = 0; i <= 96; ++i) {
    const double a = 2 * kPi * 4 * i / 96;
    coil.emplace_back(0.0105 * std::cos(a), 0.002 + 0.0105 * std::sin(a), 0.005 + 0.014 * i / 96.0);
  }
  builder.begin(size, {2, 1.0});
  add_tube(builder, coil, 0.0013, 10);
  return finish(builder, {make_plain("black_plastic", color(0x242528), 0.45),
                          make_plain("orange_rubber", color(0xd8571c), 0.6), steel()});
}
Model large_clamp(Host&, Rng) { return spring_clamp(0.86); }
Model extra_large_clamp(Host&, Rng) { return spring_clamp(1.25); }

Model screwdriver(Host&, Rng) {
  MeshBuilder builder;
  const Affine lying = turned_y(kPi / 2);
  const std::array<ProfilePoint, 7> knots{{{0.010, -0.105},
                                           {0.0155, -0.098},
                                           {0.0165, -0.075},
                                           {0.0150, -0.045},
                                           {0.0115, -0.022},
                                           {0.0125, -0.012},
                                           {0.0095, -0.005}}};
  std::vector<ProfilePoint> handle{{0, -0.105}};
  for (const ProfilePoint& p : smooth_profile(knots, 5)) handle.push_back(p);
  handle.push_back({0, -0.005});
  builder.begin(lying, {0, 1.0});
  add_lathe(builder, handle, 40, 0.8);
  for (int i = 0; i < 6; ++i) {
    const double a = 2 * kPi * i / 6;
    builder.begin(at(-0.072, 0.0158 * std::cos(a), 0.0158 * std::sin(a)) * turned_x(a), {1, 1.0});
    add_box(builder, Vec3(0.046, 0.0025, 0.007), 0.001, Axis::X, 2);
  }
  const std::array<ProfilePoint, 5> shaft{
      {{0, -0.008}, {0.0032, -0.008}, {0.0032, 0.096}, {0.0008, 0.106}, {0, 0.106}}};
  builder.begin(lying, {2, 1.0});
  add_lathe(builder, shaft, 24, 0.6);
  return finish(builder, {make_plain("handle_red", color(0xb8281f), 0.3),
                          make_plain("handle_black", color(0x1f2023), 0.5), steel()});
}

Model hammer(Host& host, Rng rng) {
  MeshBuilder builder;
  const TextureSet wood = make_wood(host, {color(0xd2ac74), color(0xa87d49), 0.6}, rng.bits(), 256);
  std::vector<PathPoint> handle;
  for (int i = 0; i <= 12; ++i) {
    const double t = i / 12.0;
    const double swell =
        0.0105 + 0.0030 * std::sin(kPi * std::min(1.0, t * 1.7)) + (t < 0.08 ? 0.003 : 0);
    handle.push_back({Vec3(-0.14 + 0.27 * t, 0, 0.016), swell * 0.8, swell * 1.1});
  }
  builder.begin(Affine::Identity(), {0, 1 / wood.size_m});
  add_sweep(builder, handle, 24, Vec3::UnitY(), 2.4);
  builder.begin(at(0.118, 0, 0.016), {1, 1.0});
  add_box(builder, Vec3(0.026, 0.042, 0.026), 0.004, Axis::Y, 3);
  const std::array<ProfilePoint, 8> face{{{0, 0.018},
                                          {0.0095, 0.018},
                                          {0.0085, 0.028},
                                          {0.0090, 0.034},
                                          {0.0135, 0.040},
                                          {0.0140, 0.050},
                                          {0.0130, 0.0525},
                                          {0, 0.053}}};
  builder.begin(at(0.118, 0, 0.016) * turned_x(-kPi / 2), {1, 1.0});
  add_lathe(builder, face, 36, 0.6);
  std::vector<PathPoint> peen;
  for (int i = 0; i <= 6; ++i) {
    const double t = i / 6.0;
    peen.push_back({Vec3(0.118, -0.018 - 0.034 * t, 0.016), std::lerp(0.0110, 0.0125, t),
                    std::lerp(0.0110, 0.0016, t)});
  }
  builder.begin(Affine::Identity(), {1, 1.0});
  add_sweep(builder, peen, 24, Vec3::UnitX(), 5.0);
  return finish(builder, {make_textured("wood", wood, 0.55),
                          make_plain("forged_steel", color(0x6f7276), 0.35, 1.0)});
}

Model adjustable_wrench(Host&, Rng) {
  MeshBuilder builder;
  const std::array<Vec2, 14> outline{Vec2(-0.11, -0.008), Vec2(-0.103, -0.012), Vec2(0.02, -0.0085),
                                     Vec2(0.045, -0.016), Vec2(0.062, -0.026),  Vec2(0.082, -0.024),
                                     Vec2(0.094, -0.013), Vec2(0.074, -0.007),  Vec2(0.070, 0.004),
                                     Vec2(0.060, 0.022),  Vec2(0.044, 0.018),   Vec2(0.02, 0.0085),
                                     Vec2(-0.103, 0.012), Vec2(-0.11, 0.008)};
  builder.begin(at(0, 0, 0.002), {0, 1.0});
  add_prism(builder, outline, 0.010, 0.0015);
  const std::array<Vec2, 6> jaw{Vec2(0.072, 0.006), Vec2(0.098, 0.007), Vec2(0.096, 0.014),
                                Vec2(0.082, 0.026), Vec2(0.066, 0.024), Vec2(0.068, 0.012)};
  builder.begin(at(0, 0, 0.0028), {1, 1.0});
  add_prism(builder, jaw, 0.0084, 0.001);
  const std::array<ProfilePoint, 6> screw{{{0, -0.008},
                                           {0.0055, -0.008},
                                           {0.0062, -0.006},
                                           {0.0062, 0.006},
                                           {0.0055, 0.008},
                                           {0, 0.008}}};
  builder.begin(at(0.060, 0.013, 0.007) * turned_z(0.2) * turned_y(kPi / 2), {1, 1.0});
  add_lathe(builder, screw, 24, 0.5);
  return finish(builder, {make_plain("chrome", color(0xc4c6c9), 0.2, 1.0),
                          make_plain("dark_steel", color(0x8b8e92), 0.3, 1.0)});
}

Model spoon(Host&, Rng) {
  MeshBuilder builder;
  const auto surface = [](double u, double v) {
    const double x = 2 * u - 1;
    const double bowl = std::clamp((v - 0.66) / 0.34, 0.0, 1.0);
    const double half =
        bowl > 0
            ? 0.0045 + 0.0165 * std::pow(std::sin(kPi * std::min(0.93, 0.03 + 0.95 * bowl)), 0.7)
            : 0.0045 + 0.0045 * std::pow(1 - v / 0.66, 2.0);
    const double depth =
        bowl > 0 ? 0.0085 * std::sin(kPi * std::min(1.0, bowl * 1.02)) * (1 - x * x) : 0.0;
    const double bow = 0.010 * std::sin(kPi * v);
    return Vec3(x * half, -0.09 + 0.18 * v, 0.010 + bow * (1 - bowl) - depth);
  };
  builder.begin(Affine::Identity(), {0, 1.0});
  add_sheet(builder, 12, 60, 0.0020, surface, Vec2(0.03, 0.18));
  return finish(builder, {make_plain("cutlery_steel", color(0xcfd1d3), 0.15, 1.0)});
}

constexpr ModelKind kTools[] = {
    {"031_spoon", 0.030, spoon},
    {"035_power_drill", 0.895, power_drill},
    {"037_scissors", 0.082, scissors},
    {"040_large_marker", 0.0158, large_marker},
    {"042_adjustable_wrench", 0.252, adjustable_wrench},
    {"044_flat_screwdriver", 0.0984, screwdriver},
    {"048_hammer", 0.665, hammer},
    {"051_large_clamp", 0.125, large_clamp},
    {"052_extra_large_clamp", 0.202, extra_large_clamp},
};

}  // namespace

std::span<const ModelKind> tools() { return kTools; }

}  // namespace diorama::samples
