// SPDX-License-Identifier: Apache-2.0
// See microfacet.h, lobes.h and bsdf.h of renderer_support.
const float kSmoothAlpha = 2e-3;
const float kMinAlpha = 1e-3;
const float kCoatF0 = 0.04;
const float kLeastDensity = 1e-12;
const float kKeptByTables = 0.9977;

vec3 mirrored(vec3 wo, vec3 h) { return 2.0 * dot(wo, h) * h - wo; }

vec3 refracted(vec3 wo, vec3 h, float eta) {
  const float cos_o = dot(wo, h);
  const float sin2_t = (1.0 - cos_o * cos_o) / (eta * eta);
  if (sin2_t >= 1.0) return vec3(0.0);
  const float cos_t = sqrt(1.0 - sin2_t);
  return unit(-wo / eta + (cos_o / eta - cos_t) * h);
}

float ggx_distribution(float cos_h, float alpha) {
  const float a2 = alpha * alpha;
  const float sin2 = max(0.0, 1.0 - cos_h * cos_h);
  const float k = sin2 + a2 * cos_h * cos_h;
  return a2 / (kPi * k * k);
}

float ggx_lambda(float cos_theta, float alpha) {
  const float c2 = cos_theta * cos_theta;
  const float tan2 = max(0.0, 1.0 - c2) / max(c2, 1e-12);
  return 0.5 * (sqrt(1.0 + alpha * alpha * tan2) - 1.0);
}

vec3 ggx_visible_normal(vec3 w, float alpha, vec2 u) {
  const vec3 stretched = unit(vec3(alpha * w.x, alpha * w.y, w.z));
  const float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
  const float r = sqrt(max(0.0, 1.0 - z * z));
  const vec3 h = vec3(r * unit_circle(u.x), z) + stretched;
  return unit(vec3(alpha * h.x, alpha * h.y, max(1e-6, h.z)));
}

float ggx_visible_normal_density(vec3 w, vec3 h, float alpha) {
  const float w_dot_h = max(0.0, dot(w, h));
  return ggx_distribution(h.z, alpha) * w_dot_h / (w.z * (1.0 + ggx_lambda(w.z, alpha)));
}

float schlick_weight(float cos_theta) {
  const float m = clamp(1.0 - cos_theta, 0.0, 1.0);
  const float m2 = m * m;
  return m2 * m2 * m;
}

float ggx_shadowing(float cos_o, float cos_i, float alpha) {
  const float masking = 1.0 + ggx_lambda(cos_o, alpha);
  return masking / (masking + ggx_lambda(cos_i, alpha));
}

float ggx_transmitted_shadowing(float cos_i, float alpha) {
  return 1.0 / (1.0 + ggx_lambda(abs(cos_i), alpha));
}

vec3 between_facets(vec3 f0, float kept) {
  const vec3 mean = f0 + (1.0 - f0) * (1.0 / 21.0);
  return mean * mean * kept / (1.0 - mean * (1.0 - kept));
}

// A SurfaceBsdf that is finished, and its LobeWeights.
struct Bsdf {
  Vec4s layer;
  Floats glass_table;
  uint layer_rows;  // 0: plain Lambert
  uint glass_rows;
  float eta;
  bool is_inside;
  vec3 base;
  float alpha;
  uint row;  // of the table
  float row_rest;
  vec3 diffuse;
  vec3 f0;
  float f90;
  vec3 multiple;
  float coat;
  float coat_alpha;
  float glass;
  float mean_missing;
  float mean_above;
  float dielectric_f0;
  float burley;
  float coat_weight;
  float metallic;
  // Seen from one direction.
  vec3 wo;
  vec4 seen;  // f0, f90, coat, above
  float lambda_o;
  float coat_lambda_o;
  float p_coat;
  float p_facets;
  float p_diffuse;
  float p_glass;
};

const float kNodes = 32.0;
const uint kNodeCount = 32u;
const uint kRows = 32u;

vec4 albedo_at(Bsdf s, float cos_theta) {
  if (s.layer_rows == 0u) return vec4(0.0);
  const float x = sqrt(max(0.0, cos_theta)) * (kNodes - 1.0);
  const uint i = min(uint(x), kNodeCount - 2u);
  const float t = x - float(i);
  const uint at = s.row * kNodeCount + i;
  const vec4 p = s.layer.v[at];
  const vec4 low = p + (s.layer.v[at + 1u] - p) * t;
  if (s.row_rest == 0.0) return low;
  const vec4 q = s.layer.v[at + kNodeCount];
  const vec4 high = q + (s.layer.v[at + kNodeCount + 1u] - q) * t;
  return low + (high - low) * s.row_rest;
}
float missing(vec4 n) { return max(0.0, 1.0 - n.x - n.y - n.z); }

bool is_lambert(Surface s) {
  return s.metallic <= 0.0 && s.specular <= 0.0 && s.coat <= 0.0 && s.has_glass == 0u;
}

Bsdf finished(Surface s, bool is_inside) {
  Bsdf b;
  b.layer = s.layer;
  b.glass_table = s.glass;
  b.layer_rows = 0u;
  b.glass_rows = s.glass_rows;
  b.eta = s.eta;
  b.is_inside = is_inside;
  b.base = s.base;
  b.alpha = s.alpha;
  b.row = 0u;
  b.row_rest = 0.0;
  b.diffuse = s.base;
  b.f0 = vec3(0.0);
  b.f90 = 0.0;
  b.multiple = vec3(0.0);
  b.coat = 0.0;
  b.coat_alpha = kMinAlpha;
  b.glass = 0.0;
  b.mean_missing = 1.0;
  b.mean_above = 0.0;
  b.dielectric_f0 = 0.04;
  b.burley = 0.0;
  b.coat_weight = s.coat;
  b.metallic = s.metallic;
  if (is_lambert(s)) {
    b.alpha = 0.25;
    return b;
  }
  b.layer_rows = s.layer_rows;
  vec4 means;
  const uint first_means = s.layer_rows * kNodeCount;
  if (s.layer_rows == 1u) {
    means = s.layer.v[first_means];
  } else {
    const float x = min(sqrt(s.alpha), 1.0) * float(kRows - 1u);
    b.row = min(uint(x), kRows - 2u);
    b.row_rest = x - float(b.row);
    const vec4 p = s.layer.v[first_means + b.row];
    means = p + (s.layer.v[first_means + b.row + 1u] - p) * b.row_rest;
  }
  const float share = s.has_glass != 0u ? (1.0 - s.metallic) * s.transmission : 0.0;
  const float plastic = (1.0 - s.metallic) - share;
  const float dielectric = plastic * s.specular;
  b.diffuse *= plastic;
  b.f0 = vec3(dielectric * s.f0) + s.metallic * s.base;
  b.f90 = dielectric + s.metallic;
  b.coat = (1.0 - share) * s.coat;
  b.coat_alpha = s.coat_alpha;
  b.glass = share;
  b.dielectric_f0 = s.f0;
  if (world.stacks_lobes != 0u) {
    b.burley = 1.0;
    return b;
  }
  b.multiple = vec3(dielectric * means.y) + s.metallic * between_facets(s.base, means.x);
  b.mean_missing = max(1e-6, means.z);
  b.mean_above = means.w;
  b.diffuse *= kKeptByTables;
  b.f0 *= kKeptByTables;
  b.f90 *= kKeptByTables;
  b.multiple *= kKeptByTables;
  b.coat *= kKeptByTables;
  return b;
}

bool is_rough(Bsdf b) {
  const float kRoughAlpha = 0.25;
  if (b.layer_rows == 0u) return true;
  return b.glass <= 0.0 && b.alpha >= kRoughAlpha &&
         (b.coat_weight <= 0.0 || b.coat_alpha >= kRoughAlpha);
}
bool is_mirror(Bsdf b) { return b.metallic > 0.9 && b.alpha < 0.0025; }

void see_from(inout Bsdf b, vec3 wo) {
  b.wo = wo;
  b.seen = albedo_at(b, wo.z);
  b.lambda_o = ggx_lambda(wo.z, b.alpha);
  b.coat_lambda_o = ggx_lambda(wo.z, b.coat_alpha);
  const float coat = (1.0 - b.glass) * b.seen.z;
  const float facets = luminance(b.f0) * b.seen.x + b.f90 * b.seen.y;
  const float diffuse =
      luminance(b.diffuse) * (1.0 - b.seen.w) + luminance(b.multiple) * missing(b.seen);
  const float sum = coat + facets + diffuse + b.glass;
  const bool is_black = !(sum > 0.0);
  const float scale = 1.0 / (is_black ? 1.0 : sum);
  b.p_coat = coat * scale;
  b.p_facets = facets * scale;
  b.p_diffuse = is_black ? 1.0 : diffuse * scale;
  b.p_glass = b.glass * scale;
}

// Share of uniform light returned to the viewer.
vec3 albedo(Bsdf b) {
  const vec3 white = vec3((1.0 - b.glass) * b.seen.z + b.f90 * b.seen.y);
  return white + vec3(b.glass) + b.f0 * b.seen.x + b.multiple * missing(b.seen) +
         b.diffuse * (1.0 - b.seen.w);
}

float fresnel_share(Bsdf b, float cos_h) {
  if (world.stacks_lobes == 0u) return schlick_weight(cos_h);
  const float root = sqrt(b.dielectric_f0);
  const float exact = fresnel_dielectric(max(1e-4, cos_h), (1.0 + root) / (1.0 - root));
  return clamp((exact - b.dielectric_f0) / (1.0 - b.dielectric_f0), 0.0, 1.0);
}

float through(Bsdf b, vec3 wi, float cos_h, vec4 at_wi) {
  if (world.stacks_lobes == 0u) return (1.0 - b.seen.w) * (1.0 - at_wi.w) / (1.0 - b.mean_above);
  const float leaving = schlick_weight(b.wo.z);
  const float arriving = schlick_weight(wi.z);
  const float back = 2.0 * sqrt(b.alpha) * cos_h * cos_h;
  const float burley = (1.0 - 0.5 * leaving) * (1.0 - 0.5 * arriving) +
                       back * (leaving + arriving + leaving * arriving * (back - 1.0));
  return 1.0 + b.burley * (burley - 1.0);
}

// The opaque lobes for wi.z > 0: rgb times cosine, and the density.
vec4 evaluate_lobes(Bsdf b, vec3 wi) {
  const bool stacks = world.stacks_lobes != 0u;
  const vec4 at_wi = albedo_at(b, wi.z);
  const float cos_over_pi = wi.z * (1.0 / kPi);
  const vec3 h = unit(b.wo + wi);
  const float cos_h = max(0.0, dot(b.wo, h));
  vec3 f_cos = vec3(0.0);
  float density = 0.0;
  if (b.layer_rows != 0u) {
    const float white = fresnel_share(b, cos_h);
    const float d = ggx_distribution(h.z, b.alpha) / (4.0 * b.wo.z);
    const float lambda_i = ggx_lambda(wi.z, b.alpha);
    const float visible = d / (1.0 + b.lambda_o);
    const float facets = stacks ? visible / (1.0 + lambda_i) : d / (1.0 + b.lambda_o + lambda_i);
    const float past_coat = stacks ? 1.0 : 1.0 - max(b.seen.z, at_wi.z);
    f_cos = (past_coat * facets) * (b.f0 * (1.0 - white) + vec3(b.f90 * white));
    density = b.p_facets * visible;
  }
  if (b.coat > 0.0) {
    const float coat_d = ggx_distribution(h.z, b.coat_alpha) / (4.0 * b.wo.z);
    const float coat_lambda_i = ggx_lambda(wi.z, b.coat_alpha);
    const float coat_visible = coat_d / (1.0 + b.coat_lambda_o);
    const float coat_facets = stacks ? 0.25 * coat_visible / (1.0 + coat_lambda_i)
                                     : coat_d / (1.0 + b.coat_lambda_o + coat_lambda_i);
    const float coat_white = kCoatF0 + (1.0 - kCoatF0) * schlick_weight(cos_h);
    f_cos += vec3(b.coat * coat_white * coat_facets);
    density += b.p_coat * coat_visible;
  }

  f_cos += (missing(b.seen) * missing(at_wi) / b.mean_missing * cos_over_pi) * b.multiple;
  f_cos += (through(b, wi, cos_h, at_wi) * cos_over_pi) * b.diffuse;
  density += b.p_diffuse * cos_over_pi;
  return vec4(f_cos, density);
}

// Glass; see GlassTable.
const float kGlassNodes = 48.0;
const uint kGlassNodeCount = 48u;

uint glass_row(Bsdf b, uint side, out float rest) {
  rest = 0.0;
  if (b.glass_rows == 1u) return side;
  const float x = min(sqrt(b.alpha), 1.0) * float(b.glass_rows - 1u);
  const uint i = min(uint(x), b.glass_rows - 2u);
  rest = x - float(i);
  return side * b.glass_rows + i;
}

float glass_at(Bsdf b, uint side, float cos_theta) {
  float rest;
  const uint row = glass_row(b, side, rest) * kGlassNodeCount;
  const float x = sqrt(clamp(cos_theta, 0.0, 1.0)) * (kGlassNodes - 1.0);
  const uint i = min(uint(x), kGlassNodeCount - 2u);
  const float t = x - float(i);
  const float p = b.glass_table.v[row + i];
  const float low = p + (b.glass_table.v[row + i + 1u] - p) * t;
  if (rest == 0.0) return low;
  const uint next = row + kGlassNodeCount + i;
  const float q = b.glass_table.v[next];
  return low + (q + (b.glass_table.v[next + 1u] - q) * t - low) * rest;
}

float glass_mean(Bsdf b, uint side) {
  float rest;
  const uint row = 2u * b.glass_rows * kGlassNodeCount + glass_row(b, side, rest);
  const float low = b.glass_table.v[row];
  return rest == 0.0 ? low : low + (b.glass_table.v[row + 1u] - low) * rest;
}

bool is_smooth_glass(Bsdf b) { return b.alpha <= kSmoothAlpha; }
bool has_smooth_part(Bsdf b) {
  return b.p_glass <= 0.0 || !is_smooth_glass(b) || b.p_coat + b.p_facets + b.p_diffuse > 1e-6;
}

vec4 evaluate_glass(Bsdf b, vec3 wi) {
  const uint side = b.is_inside ? 1u : 0u;
  const float eta = b.is_inside ? 1.0 / b.eta : b.eta;
  const bool is_reflected = wi.z > 0.0;
  const float cos_i = abs(wi.z);
  if (cos_i < 1e-6) return vec4(0.0);
  const uint exit_side = is_reflected ? side : 1u - side;
  const float lost_o = 1.0 - glass_at(b, side, b.wo.z);
  const float lost_i = 1.0 - glass_at(b, exit_side, cos_i);
  const float lost_all = 2.0 - glass_mean(b, 0u) - glass_mean(b, 1u);
  const float lost_here = 1.0 - glass_mean(b, exit_side);
  float f_cos = lost_o * lost_i / lost_all * cos_i / kPi;
  float density = lost_o * (lost_here / lost_all) * cos_i / kPi;

  vec3 h = unit(is_reflected ? b.wo + wi : -(b.wo + eta * wi));
  if (h.z < 0.0) h = -h;
  const float o_dot = dot(b.wo, h);
  const float i_dot = dot(wi, h);
  if (o_dot > 0.0 && (is_reflected ? i_dot > 0.0 : i_dot < 0.0)) {
    const float f = fresnel_dielectric(o_dot, eta);
    const float visible = ggx_visible_normal_density(b.wo, h, b.alpha);
    float single;
    float rest;
    if (is_reflected) {
      single = f * visible / (4.0 * o_dot);
      rest = ggx_shadowing(b.wo.z, cos_i, b.alpha);
    } else {
      const float root = o_dot + eta * i_dot;
      single = (1.0 - f) * visible * eta * eta * -i_dot / max(root * root, 1e-12);
      rest = ggx_transmitted_shadowing(cos_i, b.alpha);
    }
    f_cos += single * rest;
    density += (1.0 - lost_o) * single;
  }
  const vec3 tint = is_reflected ? vec3(1.0) : sqrt(b.base);
  return vec4(kKeptByTables * b.glass * f_cos * tint, b.p_glass * density);
}

vec4 evaluate_bsdf(Bsdf b, vec3 wi) {
  vec4 value = vec4(0.0);
  if (b.p_glass > 0.0 && !is_smooth_glass(b)) value = evaluate_glass(b, wi);
  if (wi.z <= 0.0) return value;
  return value + evaluate_lobes(b, wi);
}

struct BsdfSample {
  vec3 wi;
  vec3 weight;  // zero: the path ends
  float density;
  float spread;
  bool is_transmitted;
};

// Of the opaque lobes.
vec3 sample_lobes(Bsdf b, float lobe, vec2 u, out float spread) {
  const bool is_facet = lobe < b.p_coat + b.p_facets;
  const float alpha = lobe < b.p_coat ? b.coat_alpha : b.alpha;
  spread = is_facet ? alpha : 0.5;
  return is_facet ? mirrored(b.wo, ggx_visible_normal(b.wo, alpha, u)) : cosine_hemisphere(u);
}

BsdfSample sample_smooth_glass(Bsdf b, float choice) {
  const float eta = b.is_inside ? 1.0 / b.eta : b.eta;
  const float f = fresnel_dielectric(b.wo.z, eta);
  const float scale = b.glass / b.p_glass;
  if (choice < f) {
    return BsdfSample(vec3(-b.wo.xy, b.wo.z), vec3(scale), kInfinite, 0.0, false);
  }
  const vec3 wi = refracted(b.wo, vec3(0.0, 0.0, 1.0), eta);
  if (wi.z >= 0.0) return BsdfSample(vec3(0.0), vec3(0.0), 0.0, 0.0, false);
  return BsdfSample(wi, scale * sqrt(b.base), kInfinite, 0.0, true);
}

vec3 sample_rough_glass(Bsdf b, float choice, vec2 u) {
  const uint side = b.is_inside ? 1u : 0u;
  const float eta = b.is_inside ? 1.0 / b.eta : b.eta;
  const float kept = glass_at(b, side, b.wo.z);
  if (choice >= kept) {
    const float again = (choice - kept) / (1.0 - kept);
    const float lost_all = 2.0 - glass_mean(b, 0u) - glass_mean(b, 1u);
    const vec3 wi = cosine_hemisphere(u);
    return again < (1.0 - glass_mean(b, side)) / lost_all ? wi : vec3(wi.xy, -wi.z);
  }
  const vec3 h = ggx_visible_normal(b.wo, b.alpha, u);
  const bool is_reflected = choice < kept * fresnel_dielectric(dot(b.wo, h), eta);
  const vec3 wi = is_reflected ? mirrored(b.wo, h) : refracted(b.wo, h, eta);
  const bool is_on_its_side = is_reflected ? wi.z > 0.0 : wi.z < 0.0;
  return is_on_its_side ? wi : vec3(0.0);
}

// Of a surface with glass.
BsdfSample sample_bsdf(Bsdf b, float lobe, vec2 u) {
  const bool is_glass = lobe < b.p_glass;
  BsdfSample s = BsdfSample(vec3(0.0), vec3(0.0), 0.0, 0.0, false);
  if (is_glass) {
    const float choice = lobe / b.p_glass;
    if (is_smooth_glass(b)) return sample_smooth_glass(b, choice);
    s.wi = sample_rough_glass(b, choice, u);
    s.spread = b.alpha;
  } else {
    s.wi = sample_lobes(b, lobe - b.p_glass, u, s.spread);
  }
  s.is_transmitted = s.wi.z < 0.0;
  if (s.wi == vec3(0.0) || (s.is_transmitted && !is_glass)) return s;
  const vec4 value = evaluate_bsdf(b, s.wi);
  if (!(value.w > kLeastDensity)) return s;
  s.density = value.w;
  s.weight = value.xyz * (1.0 / value.w);
  return s;
}
