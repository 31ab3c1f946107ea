// What fills the screen behind or instead of the scene: the environment, and a reference picture.
import { Matrix3, Matrix4, ShaderMaterial, Vector2, type DataTexture, type IUniform, type Texture } from 'three';

const uniform = <T>(value: T): IUniform<T> => ({ value });

const vertexShader = /* glsl */ `
varying vec2 place;
void main() {
  place = position.xy;
  gl_Position = vec4( position.xy, 1.0, 1.0 );
}`;

/** A shader that fills the screen: `body` sets gl_FragColor to linear radiance at `place` in [-1, 1]^2. */
const fillScreen = (declarations: string, body: string): object => ({
  depthTest: false,
  depthWrite: false,
  vertexShader,
  fragmentShader: `
#include <common>
varying vec2 place;
${declarations}
void main() {
  ${body}
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}`,
});

/** The environment as it stands behind the scene: lat-long, first row at the zenith (docs/conventions.md). */
export class SkyMaterial extends ShaderMaterial {
  readonly map = uniform<DataTexture | null>(null);
  /** From clip space to points of the world. */
  readonly unproject = uniform(new Matrix4());
  /** From the world into the environment as it was before it was turned. */
  readonly turnBack = uniform(new Matrix3());
  /** As far from the middle as it is shown; black beyond. */
  readonly within = uniform(new Vector2(1, 1));

  constructor() {
    super(
      fillScreen(
        'uniform sampler2D map;\nuniform mat4 unproject;\nuniform mat3 turnBack;\nuniform vec2 within;',
        /* glsl */ `
  vec4 far = unproject * vec4( place, 1.0, 1.0 ), near = unproject * vec4( place, - 1.0, 1.0 );
  vec3 d = turnBack * normalize( far.xyz / far.w - near.xyz / near.w );
  vec2 at = vec2( atan( d.z, d.x ) / PI2 + 0.5, atan( length( d.xz ), d.y ) / PI );
  bool isShown = all( lessThanEqual( abs( place ), within + 1e-5 ) );
  gl_FragColor = vec4( isShown ? texture2D( map, at ).rgb : vec3( 0.0 ), 1.0 );`,
      ),
    );
    Object.assign(this.uniforms, {
      ...{ map: this.map, unproject: this.unproject, turnBack: this.turnBack, within: this.within },
    });
  }
}

/** A target of linear radiance, of the screen's size, as it is. */
export class DevelopMaterial extends ShaderMaterial {
  readonly map = uniform<Texture | null>(null);

  constructor() {
    super(
      fillScreen(
        'uniform sampler2D map;',
        'gl_FragColor = vec4( texelFetch( map, ivec2( gl_FragCoord.xy ), 0 ).rgb, 1.0 );',
      ),
    );
    Object.assign(this.uniforms, { map: this.map });
  }
}

/** A picture of linear radiance, first row at the top, that fills the screen's height. */
export class PictureMaterial extends ShaderMaterial {
  readonly map = uniform<DataTexture | null>(null);
  /** How many times as wide as the picture the screen is. */
  readonly stretch = uniform(1);

  constructor() {
    super(
      fillScreen(
        'uniform sampler2D map;\nuniform float stretch;',
        /* glsl */ `
  vec2 uv = vec2( 0.5 + 0.5 * place.x * stretch, 0.5 - 0.5 * place.y );
  gl_FragColor = vec4( abs( uv.x - 0.5 ) <= 0.5 ? texture2D( map, uv ).rgb : vec3( 0.0 ), 1.0 );`,
      ),
    );
    Object.assign(this.uniforms, { map: this.map, stretch: this.stretch });
  }
}
