// The organ's fine surface: arrays of the module, drawn with the organ's shader and its picture. It
// takes the place of the outside of the mesh's surface.

import {
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  GLSL3,
  LinearMipmapLinearFilter,
  Mesh,
  NoColorSpace,
  RawShaderMaterial,
  RepeatWrapping,
  Texture,
  type IUniform,
} from 'three';
import { lightingSource, organFragmentSource, organVertexSource } from './gen/shaders';
import type { Replica } from './replica';

export class FineLayer {
  readonly mesh: Mesh<BufferGeometry, RawShaderMaterial>;
  fault = ''; // one line for people: its picture cannot be shown
  private readonly picture: IUniform<Texture | null> = { value: null };
  private readonly hasPicture: IUniform<number> = { value: 0 };
  private geometryVersion = -1;
  private motionVersion = -1;
  private pictureVersion = -1;

  constructor(uniforms: Record<string, IUniform>) {
    this.mesh = new Mesh(
      new BufferGeometry(),
      new RawShaderMaterial({
        glslVersion: GLSL3,
        vertexShader: organVertexSource,
        uniforms: { ...uniforms, picture: this.picture, has_picture: this.hasPicture },
      }),
    );
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
  }
  get isShown(): boolean {
    return this.mesh.visible;
  }
  // `head`: what the shaders of this quality begin with.
  setHead(head: string): void {
    this.mesh.material.fragmentShader =
      head + '#define PICTURE 1\n' + lightingSource + organFragmentSource;
    this.mesh.material.needsUpdate = true;
  }
  // Takes over what the module has, after its update and just before the picture is drawn: the
  // arrays are views of its memory, and hold until the next call that makes it grow.
  load(replica: Replica): void {
    const fine = replica.fine();
    this.mesh.visible = fine !== null;
    if (!fine) {
      if (this.geometryVersion >= 0) this.clear();
      return;
    }
    if (fine.geometryVersion !== this.geometryVersion) {
      const g = this.mesh.geometry;
      g.dispose();
      g.setAttribute('rest', new BufferAttribute(fine.rest.slice(), 4));
      g.setAttribute('texture_place', new BufferAttribute(fine.texture.slice(), 2));
      g.setIndex(new BufferAttribute(fine.triangles.slice(), 1));
      for (const [name, array, size, isShare] of [
        ['position', fine.positions, 3, false],
        ['normal', fine.normals, 3, false],
        ['lip', fine.lips, 4, true],
        ['overlay', fine.overlay, 4, true],
      ] as const) {
        const attribute = new BufferAttribute(array, size, isShare);
        attribute.usage = DynamicDrawUsage;
        g.setAttribute(name, attribute);
      }
      this.geometryVersion = fine.geometryVersion;
    } else if (fine.motionVersion !== this.motionVersion) {
      for (const [name, array] of [
        ['position', fine.positions],
        ['normal', fine.normals],
        ['lip', fine.lips],
        ['overlay', fine.overlay],
      ] as const) {
        const attribute = this.mesh.geometry.getAttribute(name) as BufferAttribute;
        attribute.array = array;
        attribute.needsUpdate = true;
      }
    }
    this.motionVersion = fine.motionVersion;
    if (fine.pictureVersion !== this.pictureVersion) {
      this.pictureVersion = fine.pictureVersion;
      this.loadPicture(replica.finePicture());
    }
  }
  dispose(): void {
    this.clear();
    this.mesh.material.dispose();
  }

  private clear(): void {
    this.mesh.geometry.dispose();
    this.mesh.geometry = new BufferGeometry();
    this.geometryVersion = this.motionVersion = this.pictureVersion = -1;
    this.loadPicture(null);
  }
  private showPicture(texture: Texture | null): void {
    (this.picture.value?.image as ImageBitmap | undefined)?.close();
    this.picture.value?.dispose();
    this.picture.value = texture;
    this.hasPicture.value = texture ? 1 : 0;
  }
  // The browser unpacks it; its size was looked at before (client/web/wasm/page_fine.cpp).
  private loadPicture(file: Uint8Array<ArrayBuffer> | null): void {
    const version = this.pictureVersion;
    this.fault = '';
    this.showPicture(null);
    if (file === null) return;
    createImageBitmap(new Blob([file]), {
      colorSpaceConversion: 'none',
      premultiplyAlpha: 'none',
    }).then(
      bitmap => {
        if (this.pictureVersion !== version) return bitmap.close();
        const texture = new Texture(bitmap);
        texture.flipY = false;
        texture.colorSpace = NoColorSpace;
        texture.wrapS = texture.wrapT = RepeatWrapping;
        texture.minFilter = LinearMipmapLinearFilter;
        texture.needsUpdate = true;
        this.showPicture(texture);
      },
      () => {
        if (this.pictureVersion === version)
          this.fault = 'the organ is drawn without its picture: this browser cannot read it';
      },
    );
  }
}
