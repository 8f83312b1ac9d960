// SPDX-License-Identifier: Apache-2.0
#include "texture_choice.h"

#include "sampling.h"

namespace diorama {

TextureChoice::TextureChoice(TextDistribution names, const Host& host)
    : names_(std::move(names)), host_(host), read_(names_.texts().size()) {
  for (const std::string& name : names_.texts()) (void)host_.resolve(name);
}

std::shared_ptr<const Texture> TextureChoice::draw(NodeDraws& draws) {
  const std::size_t index = draws.text(names_);
  if (auto known = read_[index].lock()) return known;
  auto made = host_.read_texture(host_.resolve(names_.texts()[index]));
  read_[index] = made;
  return made;
}

}  // namespace diorama
