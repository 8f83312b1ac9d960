// SPDX-License-Identifier: Apache-2.0
#include "loader_support/texture_decoder.h"

#include <exception>

namespace diorama::loader_support {

void TextureDecoder::announce(const std::string& identifier, Decode decode) {
  pictures_.try_emplace(identifier, Picture{std::move(decode), nullptr, nullptr, false});
}

void TextureDecoder::decode(Picture& picture) {
  try {
    picture.texture = picture.decode();
  } catch (...) {
    picture.error = std::current_exception();
  }
  picture.is_decoded = true;
}

void TextureDecoder::decode_announced() {
  std::vector<Picture*> waiting;
  for (auto& [identifier, picture] : pictures_) {
    if (!picture.is_decoded) waiting.push_back(&picture);
  }
  host_.parallel_for(waiting.size(), [&](std::size_t i) { decode(*waiting[i]); });
}

std::shared_ptr<const Texture> TextureDecoder::get(const std::string& identifier,
                                                   std::optional<ColorSpace> space) {
  if (space) {
    const auto known = converted_.find({identifier, *space});
    if (known != converted_.end()) return known->second;
  }
  Picture& picture = pictures_.at(identifier);
  // Most pictures are used in one space only, so the first reading is given up for a converted one;
  // should it be asked for after all, it is decoded again.
  if (!picture.is_decoded || (!picture.texture && !picture.error)) decode(picture);
  if (picture.error) std::rethrow_exception(picture.error);
  const Texture& texture = *picture.texture;
  if (!space || texture.color_space == *space || !texture.floats.empty()) return picture.texture;
  auto copy = std::make_shared<Texture>(texture);
  copy->color_space = *space;
  picture.texture.reset();
  return converted_[{identifier, *space}] = std::move(copy);
}

}  // namespace diorama::loader_support
