// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "writer_imagefolder/image_folder_reader.h"
#include "writer_imagefolder/image_folder_writer.h"

DIORAMA_PLUGIN("writer_imagefolder", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::ImageFolderWriter, "ImageFolderWriter",
              "Writes an image folder with metadata.jsonl for Hugging Face Datasets.");
  DIORAMA_ADD_READER(diorama::ImageFolderReader, "ImageFolderReader",
                     "Reads image folders: with metadata.jsonl or .csv, or a folder per class.",
                     "metadata.jsonl metadata.csv */metadata.jsonl */metadata.csv */*.png */*.jpg "
                     "*/*.jpeg */*/*.png */*/*.jpg */*/*.jpeg");
}
