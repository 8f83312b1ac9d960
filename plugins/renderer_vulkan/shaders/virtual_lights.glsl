// SPDX-License-Identifier: Apache-2.0
// Surfaces that paths are connected with; see virtual_lights.h and surface_parts.h of
// renderer_support.
const uint kCandidates = 4u;

// Of four times a light, per square metre, for the side of a surface that the path met.
float rival_density(SurfacePoint s) {
  const uint entry = 3u * (job.part_starts.v[s.instance] + s.number);
  uint part = job.part_triangles.v[entry];
  const uint rows = job.part_triangles.v[entry + 1u];
  if (rows > 0u) {
    const vec2 at = max(vec2(0.0), s.at * float(rows));
    const uint i = min(uint(at.x), rows - 1u);
    const uint j = min(uint(at.y), rows - 1u - i);
    const bool is_turned = (at.x - float(i)) + (at.y - float(j)) > 1.0 && i + j + 1u < rows;
    part += i * (2u * rows - i) + 2u * j + (is_turned ? 1u : 0u);
  }
  const bool is_mirrored = (world.instances.v[s.instance].flags & kMirrored) != 0u;
  return float(kCandidates) *
         job.part_densities.v[2u * part + (s.is_back != is_mirrored ? 1u : 0u)];
}

struct Choice {
  uint light;  // kNone: none would bring anything
  float rival;
  float weight;
};

Choice choose_virtual_light(SurfacePoint s, float u, float pick) {
  Choice choice = Choice(kNone, 0.0, 0.0);
  if (job.virtual_light_count == 0u) return choice;
  const float count = float(job.virtual_light_count);
  vec4 scores;
  for (uint k = 0u; k < kCandidates; ++k) {
    const float place = (u + float(k)) * (1.0 / float(kCandidates)) * count;
    const uint number = min(uint(place), job.virtual_light_count - 1u);
    const vec4 a = job.candidates.v[2u * number];
    const vec4 b = job.candidates.v[2u * number + 1u];
    const vec3 to = a.xyz - s.position;
    const float distance2 = dot(to, to);
    const float here = dot(s.normal, to);
    const float there = -dot(b.xyz, to);
    const bool is_facing = here > 0.0 && there > 0.0 && dot(s.flat_normal, to) > 0.0;
    const float geometry = here * there / (distance2 * distance2);
    const float rival = float(kCandidates) * a.w;
    const float score = b.w * geometry * rival / (rival + geometry / kPi);
    scores[k] = is_facing ? score : 0.0;
  }
  const float sum = scores.x + scores.y + scores.z + scores.w;
  if (!(sum > 0.0)) return choice;
  float rest = pick * sum;
  uint chosen = 0u;
  bool is_found = false;
  for (uint k = 0u; k < kCandidates; ++k) {
    if (is_found || !(scores[k] > 0.0)) continue;
    chosen = k;
    is_found = rest < scores[k];
    rest -= scores[k];
  }
  const float place = (u + float(chosen)) * (1.0 / float(kCandidates)) * count;
  choice.light = min(uint(place), job.virtual_light_count - 1u);
  choice.rival = float(kCandidates) * job.candidates.v[2u * choice.light].w;
  choice.weight = sum / (scores[chosen] * float(kCandidates));
  return choice;
}

vec3 radiance_towards(uint light, vec3 direction) {
  const vec3 normal = job.virtual_lights.v[light].normal;
  const mat3 basis = basis_around(normal);
  Bsdf bsdf = finished(job.virtual_lights.v[light].surface, false);
  vec3 wo = to_local(basis, direction);
  wo.z = max(wo.z, 1e-4);
  see_from(bsdf, unit(wo));
  const vec3 wi = to_local(basis, job.virtual_lights.v[light].to_light);
  return evaluate_lobes(bsdf, wi).xyz * job.virtual_lights.v[light].irradiance;
}

// With one virtual light, whose weight is that of the way over it beside the path's own way there.
void connect(Path path, SurfacePoint s, Bsdf bsdf, mat3 basis, float u, inout ShadowRay connection) {
  const uint bits = hashed(floatBitsToUint(u) + hashed(path.random.place));
  const Choice choice = choose_virtual_light(s, u, fraction(bits));
  if (choice.light == kNone) return;
  const vec3 position = job.candidates.v[2u * choice.light].xyz;
  const vec3 flat_normal = job.candidates.v[2u * choice.light + 1u].xyz;
  const vec3 to = position - s.position;
  const float distance2 = dot(to, to);
  const vec3 towards = to * (1.0 / sqrt(distance2));
  const vec3 wi = to_local(basis, towards);
  if (!(wi.z > 0.0)) return;
  const vec4 value = evaluate_lobes(bsdf, wi);
  const float per_area = -dot(flat_normal, towards) / distance2;
  const float own = value.w * per_area;
  const float weight = choice.weight * per_area * choice.rival / (own + choice.rival);
  // To where its own rays begin, too: what lies closer hides neither.
  const vec3 from = leave(s.position, s.flat_normal, towards);
  const vec3 way = position + step_length(position) * flat_normal - from;
  const float distance = sqrt(dot(way, way));
  connection.is_wanted = true;
  connection.origin = from;
  connection.direction = way * (1.0 / distance);
  connection.reach = 0.99999 * distance;
  connection.light =
      path.throughput * value.xyz * radiance_towards(choice.light, -towards) * weight;
  connection.is_indirect = path.bounce > 0;
  // Also from where it begins: what comes over a further surface belongs to it.
  connection.is_finding = has(path, kHasFinding);
}

// What the light found at a vertex counts for, as virtual lights bring a part of it.
float share_beside_virtual_lights(Path path, SurfacePoint s) {
  const float cosine = abs(dot(s.flat_normal, path.direction));
  const float own = path.last_density * cosine / (path.since_last * path.since_last);
  return own / (own + rival_density(s));
}
