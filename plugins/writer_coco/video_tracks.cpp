// SPDX-License-Identifier: Apache-2.0
#include "writer_coco/video_tracks.h"

#include <algorithm>
#include <functional>
#include <map>
#include <set>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "writer_support/run_length.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTracks = "tracks agree with annotations";

std::uint64_t digest(const Json& json) { return std::hash<std::string>()(json.dump()); }

std::uint64_t box_digest(const Json& category, const Json& box, const Json& area) {
  return digest(Json::array({category, box, area}));
}

/// Packed masks and runs as numbers are equal when they mean the same.
std::uint64_t mask_digest(const Json& segmentation) {
  if (!segmentation.is_object()) return 0;
  if (!segmentation.contains("counts") || !segmentation.at("counts").is_array()) {
    return digest(segmentation);
  }
  const Json& counts = segmentation.at("counts");
  const Json& size = segmentation.at("size");
  RunLength runs;
  runs.height = whole_number<int>(size.at(0));
  runs.width = whole_number<int>(size.at(1));
  for (const Json& count : counts) runs.counts.push_back(whole_number<std::uint32_t>(count));
  return digest(coco_rle(runs));
}

/// The video of a capture's picture, and the clip that it is of.
struct VideoOfClip {
  std::size_t clip = 0;
  std::int64_t video = 0;
};

class VideoTracks {
 public:
  VideoTracks(const fs::path& folder, const CocoTables& tables, const DatasetPage& page,
              const std::vector<TrackedAnnotation>& annotations, StoredFiles& files)
      : folder_(folder), tables_(tables), page_(page), files_(files) {
    for (const CocoImageEntry& image : tables.images) image_of_id_.emplace(image.id, &image);
    for (const TrackedAnnotation& each : annotations) {
      const auto image = image_of_id_.find(each.image_id);
      if (image == image_of_id_.end()) continue;
      of_frame_.emplace(std::tuple(image->second->capture, image->second->camera, each.track),
                        &each);
    }
  }

  void check_nodes() {
    std::map<std::pair<std::int64_t, std::uint32_t>, std::uint64_t> nodes;
    std::map<std::pair<std::int64_t, std::uint64_t>, std::uint32_t> tracks;
    for (const auto& [key, annotation] : of_frame_) {
      const auto& [capture, camera, track] = key;
      const auto at = video_at(capture, camera);
      if (!at) continue;
      const auto node = nodes.emplace(std::pair(at->video, track), annotation->node).first;
      const auto own = tracks.emplace(std::pair(at->video, annotation->node), track).first;
      files_.check(node->second == annotation->node && own->second == track, kTracks,
                   tables_.parts[image_of_id_.at(annotation->image_id)->part].file,
                   "image " + std::to_string(annotation->image_id),
                   "its track " + std::to_string(track) + " is of another node",
                   "the one that it has in other frames");
    }
  }

  void check_files() {
    std::error_code ignored;
    if (!fs::is_directory(folder_ / "youtube_vis", ignored)) return;
    for (const CocoPart& part : tables_.parts) {
      const std::string file = "youtube_vis/" + part.split + ".json";
      files_.check(files_.has(file), kMissing, file, "", "the file is not there",
                   "one beside " + part.file);
      if (!files_.has(file)) continue;
      videos_.clear();
      told_.clear();
      files_.reading(file, [&] {
        visit_json_file(folder_ / file, [&](const std::string& key, bool is_element, JsonSpan,
                                            std::string_view text) {
          if (!is_element) return;
          if (key == "videos") check_video(file, part.split, parse_stored_json(text));
          if (key == "annotations") check_track(file, parse_stored_json(text));
          if (key == "categories") check_category(file, part, parse_stored_json(text));
        });
      });
      check_complete(file, part.split);
    }
  }

 private:
  /// Our writer counts videos by clip and camera, from 1.
  std::int64_t video_of(std::size_t clip, std::size_t camera) const {
    return std::int64_t(clip * page_.cameras.size() + camera) + 1;
  }

  std::optional<VideoOfClip> video_at(int capture, std::size_t camera) const {
    const auto at = clip_frame(page_.clips, capture);
    if (!at) return std::nullopt;
    const auto clip = std::size_t(at->clip);
    return VideoOfClip{clip, video_of(clip, camera)};
  }

  /// Clip and camera of a video; nothing for one that dataset.json does not tell of.
  std::optional<std::pair<const DatasetClip*, std::size_t>> clip_of(std::int64_t video) const {
    const auto cameras = std::int64_t(page_.cameras.size());
    if (video < 1 || cameras == 0) return std::nullopt;
    const auto clip = std::size_t((video - 1) / cameras);
    if (clip >= page_.clips.size()) return std::nullopt;
    return std::pair(&page_.clips[clip], std::size_t((video - 1) % cameras));
  }

  bool is_of_split(const DatasetClip& clip, const std::string& split) const {
    const auto found = page_.split_of_capture.find(clip.first);
    return found != page_.split_of_capture.end() && found->second == split;
  }

  void check_video(const std::string& file, const std::string& split, const Json& json) {
    const auto id = whole_number<std::int64_t>(json.at("id"));
    const std::string who = "video " + std::to_string(id);
    const auto of = clip_of(id);
    const bool is_known = of && is_of_split(*of->first, split);
    files_.check(is_known, kCounts, file, who, "is none of " + split + " by dataset.json");
    files_.check(videos_.insert(id).second, kOnce, file, who, "is there twice");
    if (!is_known) return;
    const DatasetClip& clip = *of->first;
    const Json& names = json.at("file_names");
    files_.check(json.at("length") == clip.count && names.size() == std::size_t(clip.count) &&
                     json.at("fps").get<double>() == clip.fps,
                 kCounts, file, who,
                 "its length, pictures and fps are " + json.at("length").dump() + ", " +
                     std::to_string(names.size()) + ", " + json.at("fps").dump(),
                 std::to_string(clip.count) + " frames, " + std::to_string(clip.fps) +
                     " per second, as dataset.json says");
    for (int frame = 0; frame < std::min(clip.count, int(names.size())); ++frame) {
      const CocoImageEntry* image = image_of(clip.first + frame, of->second);
      if (!image) continue;
      const Json own =
          parse_stored_json(read_span(folder_ / tables_.parts[image->part].file, image->span));
      const auto same = [&](const char* key) { return own.at(key) == json.at(key); };
      files_.check(
          names[std::size_t(frame)] == own.at("file_name") && same("width") && same("height"),
          kCounts, file, who + ", frame " + std::to_string(frame),
          "its picture or size is not that of image " + std::to_string(image->id));
    }
  }

  void check_track(const std::string& file, const Json& json) {
    const auto video = whole_number<std::int64_t>(json.at("video_id"));
    const auto track = whole_number<std::uint32_t>(json.at("track_id"));
    const std::string who = "video " + std::to_string(video) + ", track " + std::to_string(track);
    const auto of = clip_of(video);
    files_.check(of && videos_.contains(video), kIds, file, who, "is of an unknown video");
    if (!of) return;
    files_.check(told_.emplace(video, track).second, kOnce, file, who, "is there twice");
    const auto count = std::size_t(of->first->count);
    const Json& boxes = json.at("bboxes");
    const Json& areas = json.at("areas");
    const Json& masks = json.at("segmentations");
    const bool fits = boxes.size() == count && areas.size() == count && masks.size() == count;
    files_.check(fits, kCounts, file, who, "has lists of other lengths than its video");
    if (!fits) return;
    for (std::size_t frame = 0; frame < count; ++frame) {
      const int capture = of->first->first + int(frame);
      const auto own = of_frame_.find(std::tuple(capture, of->second, track));
      const std::string at = who + ", frame " + std::to_string(frame);
      const bool is_told =
          !boxes[frame].is_null() && !areas[frame].is_null() && !masks[frame].is_null();
      const bool is_empty =
          boxes[frame].is_null() && areas[frame].is_null() && masks[frame].is_null();
      files_.check(own == of_frame_.end() ? is_empty : is_told, kTracks, file, at,
                   is_empty ? "is not there" : "has a box, a mask or an area",
                   own == of_frame_.end() ? "nothing: the image has no such annotation"
                                          : "box, mask and area of the image's annotation");
      if (own == of_frame_.end() || !is_told) continue;
      const TrackedAnnotation& said = *own->second;
      files_.check(said.box == box_digest(json.at("category_id"), boxes[frame], areas[frame]) &&
                       (said.mask == 0 || said.mask == mask_digest(masks[frame])),
                   kTracks, file, at,
                   "its category, box, area or mask is not that of the annotation in image " +
                       std::to_string(said.image_id));
    }
  }

  void check_category(const std::string& file, const CocoPart& part, const Json& json) {
    const auto found = part.categories.find(whole_number<std::int64_t>(json.at("id")));
    files_.check(found != part.categories.end() && json.at("name") == found->second.name, kIds,
                 file, "category " + json.at("id").dump(), "is none of " + part.file);
  }

  void check_complete(const std::string& file, const std::string& split) {
    for (std::size_t clip = 0; clip < page_.clips.size(); ++clip) {
      if (!is_of_split(page_.clips[clip], split)) continue;
      for (std::size_t camera = 0; camera < page_.cameras.size(); ++camera) {
        const std::int64_t video = video_of(clip, camera);
        files_.check(videos_.contains(video), kMissing, file, "video " + std::to_string(video),
                     "is not there", "one for each clip and camera");
      }
    }
    std::set<std::pair<std::int64_t, std::uint32_t>> missing;
    for (const auto& [key, annotation] : of_frame_) {
      const auto& [capture, camera, track] = key;
      const auto at = video_at(capture, camera);
      if (!at || !is_of_split(page_.clips[at->clip], split)) continue;
      const bool is_there = told_.contains({at->video, track});
      if (!is_there) missing.emplace(at->video, track);
    }
    for (const auto& [video, track] : missing) {
      files_.find(kMissing, file,
                  "video " + std::to_string(video) + ", track " + std::to_string(track),
                  "is not there", "the images have annotations of it");
    }
  }

  const CocoImageEntry* image_of(int capture, std::size_t camera) const {
    const auto& images = tables_.images;
    const auto found = std::ranges::lower_bound(
        images, std::pair(capture, camera), {}, [](const CocoImageEntry& image) {
          return std::pair(image.capture, std::size_t(image.camera));
        });
    const bool is_it =
        found != images.end() && found->capture == capture && found->camera == camera;
    return is_it ? &*found : nullptr;
  }

  const fs::path& folder_;
  const CocoTables& tables_;
  const DatasetPage& page_;
  StoredFiles& files_;
  std::unordered_map<std::int64_t, const CocoImageEntry*> image_of_id_;
  /// By capture, camera and track.
  std::map<std::tuple<int, std::size_t, std::uint32_t>, const TrackedAnnotation*> of_frame_;
  std::set<std::int64_t> videos_;                          ///< Of the file at hand.
  std::set<std::pair<std::int64_t, std::uint32_t>> told_;  ///< Video and track.
};

}  // namespace

TrackedAnnotation tracked_annotation(const Json& annotation) {
  TrackedAnnotation tracked;
  tracked.image_id = whole_number<std::int64_t>(annotation.at("image_id"));
  tracked.track = whole_number<std::uint32_t>(annotation.at("track_id"));
  tracked.node = annotation.contains("node") ? digest(annotation.at("node")) : tracked.track;
  tracked.box =
      box_digest(annotation.at("category_id"), annotation.at("bbox"), annotation.at("area"));
  if (annotation.contains("segmentation")) {
    tracked.mask = mask_digest(annotation.at("segmentation"));
  }
  return tracked;
}

void check_video_tracks(const fs::path& folder, const CocoTables& tables, const DatasetPage& page,
                        const std::vector<TrackedAnnotation>& annotations, StoredFiles& files) {
  VideoTracks tracks(folder, tables, page, annotations, files);
  tracks.check_nodes();
  tracks.check_files();
}

}  // namespace diorama
